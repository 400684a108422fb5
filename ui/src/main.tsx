import { createRoot } from "react-dom/client";
import { connect } from "./api/live";
import { Shell } from "./app/Shell";
import { applyTheme } from "./app/theme";
import { loadKinds } from "./rig/kinds";
import { receiveConfig } from "./state/draft";
import "./styles/base.css";
import "./styles/controls.css";
import "./styles/shell.css";
import "./styles/configure.css";
import "./styles/run.css";
import "./styles/datasets.css";
import "./styles/life.css";

applyTheme();
connect(receiveConfig);
void loadKinds();
const root = document.getElementById("root");
if (root) createRoot(root).render(<Shell />);
