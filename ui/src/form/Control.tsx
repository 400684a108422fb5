import { ChoicesField, MappingField, RowsField, SectionField, VariantsField } from "./compound";
import { useForm } from "./context";
import { DrawnField } from "./DrawnField";
import { choiceSection } from "./groups";
import { ListField } from "./ListField";
import {
  EnumField,
  NameField,
  NumberField,
  PairField,
  TextField,
  Toggle,
  type ControlProps,
} from "./simple";

const MOST_IN_A_MENU = 60;

/** The control that fits a field. */
export function Control(props: ControlProps) {
  const { field, path } = props;
  const { suggestions } = useForm();
  switch (field.kind) {
    case "toggle":
      return <Toggle {...props} />;
    case "number":
      return <NumberField {...props} />;
    case "text": {
      const names = suggestions(path);
      return names && names.length <= MOST_IN_A_MENU ? (
        <NameField {...props} names={names} />
      ) : (
        <TextField {...props} />
      );
    }
    case "enum":
      return <EnumField {...props} />;
    case "pair":
      return <PairField {...props} />;
    case "list":
      return <ListField {...props} />;
    case "rows":
      return <RowsField {...props} />;
    case "section":
      return choiceSection(field) ? <DrawnField {...props} /> : <SectionField {...props} />;
    case "variants":
      return <VariantsField {...props} />;
    case "choices":
      return <ChoicesField {...props} />;
    case "mapping":
      return <MappingField {...props} />;
    case "const":
      return null;
  }
}
