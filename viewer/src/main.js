// Finds the places of players in the page and fills them. The build runs this once, however often a page brings it.

import "uplot/dist/uPlot.min.css";

import { Player } from "./player.js";
import "./style.css";

const oarlock = (window.oarlock ??= {});
oarlock.players ??= [];

function fill() {
  for (const script of document.querySelectorAll("script.oarlock-scene:not([data-drawn])")) {
    const place = document.getElementById(script.dataset.for);
    if (!place) continue;
    script.dataset.drawn = "";
    oarlock.players.push(new Player(place, JSON.parse(script.textContent)));
  }
}

oarlock.fill = fill;
if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", fill);
else fill();
