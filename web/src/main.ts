/** Makes the page interactive. Without this code, the page shows the same results as static pictures and tables. */

import "uplot/dist/uPlot.min.css";
import "./page.css";
import { read, unpack } from "./data";
import { enhance } from "./figure";
import { State } from "./state";
import { switches } from "./switches";
import { enhanceTable } from "./table";

async function start(): Promise<void> {
  for (const table of document.querySelectorAll("table")) enhanceTable(table);
  const data = read();
  // In an old browser, the static pictures stay.
  if (data === null || data.figures.length === 0 || !("DecompressionStream" in window)) return;
  const words = await unpack(data.block);
  const state = new State(data);
  const places = data.figures.flatMap((figure) => {
    const place = document.getElementById(figure.name);
    return place === null ? [] : [{ figure, place }];
  });
  const bar = switches(data, state);
  if (bar.childElementCount > 0) places[0]?.place.before(bar);
  for (const { figure, place } of places) enhance(place, figure, data, state, words);
}

void start();
