import { lazy, Suspense } from "react";
import { live } from "../api/live";
import { ConfigurePage } from "../configure/ConfigurePage";
// The page's head names the file, too: inlined here or not would be a matter of chance.
import icon from "../icon.svg?no-inline";
import { kindTable } from "../rig/kinds";
import { useStore } from "../state/store";
import { Icon } from "../ui/Icon";
import { percent } from "../ui/format";
import { href, useRoute, type Route } from "./routes";
import { Shortcuts } from "./Shortcuts";
import { useTheme } from "./theme";

const RunPage = lazy(() => import("../run/RunPage"));
const RunsPage = lazy(() => import("../run/RunsPage"));
const ComparePage = lazy(() => import("../run/ComparePage"));
const DatasetsPage = lazy(() => import("../datasets/DatasetsPage"));
const EpisodePage = lazy(() => import("../episode/EpisodePage"));

/** The frame of all pages: where one is, how the server does, light or dark. */
export function Shell() {
  const route = useRoute();
  const { kinds, error } = useStore(kindTable, (now) => now);
  return (
    <>
      <button type="button" className="skip" onClick={() => document.getElementById("content")?.focus()}>
        Skip to the content
      </button>
      <TopBar route={route} />
      <div className="content" id="content" tabIndex={-1}>
        <Suspense fallback={<p className="empty">Loading…</p>}>
          {kinds ? <Page route={route} /> : <p className="empty page-error">{error ?? "Loading…"}</p>}
        </Suspense>
      </div>
    </>
  );
}

function Page({ route }: { route: Route }) {
  switch (route.page) {
    case "configure":
      return <ConfigurePage />;
    case "run":
      return <RunPage run={route.run} />;
    case "runs":
      return <RunsPage />;
    case "compare":
      return <ComparePage />;
    case "datasets":
      return <DatasetsPage dataset={route.dataset} />;
    case "episode":
      return <EpisodePage key={`${route.dataset}/${route.episode}`} dataset={route.dataset} episode={route.episode} />;
  }
}

function TopBar({ route }: { route: Route }) {
  const { connection, runs } = useStore(live, (now) => now);
  const [theme, toggle] = useTheme();
  const going = runs.find((run) => run.alive === "running" || run.alive === "stalled");
  const tab = (page: Route["page"], label: string, target: Route) => {
    const here = route.page === page || (page === "datasets" && route.page === "episode") || (page === "run" && (route.page === "runs" || route.page === "compare"));
    return (
      <a href={href(target)} aria-current={here ? "page" : undefined}>
        {label}
        {page === "run" && going && <span className="badge badge-live">{percent(going.progress ?? 0)}</span>}
      </a>
    );
  };
  return (
    <header className="top-bar">
      <a className="brand" href="#/configure">
        <img src={icon} alt="" width="24" height="24" />
        Car-STAGE
      </a>
      <nav aria-label="Pages">
        {tab("configure", "Configure", { page: "configure" })}
        {tab("run", "Run", { page: "run", run: null })}
        {tab("datasets", "Datasets", { page: "datasets", dataset: null })}
      </nav>
      <span className="spacer" />
      <span className={`connection connection-${connection}`} role="status">
        <span className="dot" />
        {connection === "online" ? "connected" : connection === "connecting" ? "connecting" : "reconnecting"}
      </span>
      <Shortcuts />
      <button
        type="button"
        className="icon-button"
        aria-label={theme === "dark" ? "Light theme" : "Dark theme"}
        title={theme === "dark" ? "Light theme" : "Dark theme"}
        onClick={toggle}
      >
        <Icon name={theme === "dark" ? "sun" : "moon"} />
      </button>
    </header>
  );
}
