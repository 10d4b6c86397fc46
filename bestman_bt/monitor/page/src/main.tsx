import { render } from "preact";
import { App } from "./App";
import { startKeyboard } from "./keyboard";
import { start } from "./monitor";
import { startTheme } from "./theme";
import "virtual:palette.css";
import "./style/tokens.css";
import "./style/page.css";
import "./style/tree.css";
import "./style/panels.css";
import "./style/timeline.css";
import "./style/dialogs.css";

startTheme();
startKeyboard();
start();
render(<App />, document.getElementById("page")!);
