// The live page: one session, shown as it runs. Every text comes from the server's own messages.

import { App } from "./app.js";
import "./page.css";

const place = document.getElementById("oarlock-live");
(window.oarlock ??= {}).live = new App(place);
