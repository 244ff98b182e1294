/** Tables: sorting, copying, and a matrix of colors for long ones. The table is there without this code, too. */

import { button, group } from "./controls";

/** Tables with more rows can be shown as a matrix. */
const LONG = 40;

/** Text of a cell in one line. */
function textOf(cell: HTMLTableCellElement): string {
  return cell.dataset["text"] ?? (cell.innerText ?? "").replace(/\s+/g, " ").trim();
}

/** The first number in a text; NaN without one. */
export function numberIn(text: string): number {
  const found = /[−-]?\d+(\.\d+)?([eE][−+-]?\d+)?/.exec(text);
  return found === null ? NaN : Number(found[0].replaceAll("−", "-"));
}

/** Titles, then rows, as texts; a cell over several rows is in each of them. */
export function matrix(table: HTMLTableElement): string[][] {
  const head = [...(table.tHead?.rows[0]?.cells ?? [])].map((cell) => cell.dataset["text"] ?? textOf(cell));
  const rows = [...table.tBodies].flatMap((body) => {
    let first = "";
    return [...body.rows].map((row) => {
      const cells = [...row.cells];
      const spans = cells[0]?.rowSpan ?? 1;
      if (cells[0]?.tagName === "TH") first = textOf(cells[0]);
      const isWhole = cells[0]?.tagName === "TH" || spans > 1;
      return isWhole ? cells.map(textOf) : [first, ...cells.map(textOf)];
    });
  });
  return [head, ...rows];
}

export function csv(rows: string[][]): string {
  const quoted = (cell: string) => (/[",\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell);
  return rows.map((row) => row.map(quoted).join(",")).join("\n") + "\n";
}

export function markdown([head, ...rows]: string[][]): string {
  const line = (cells: string[]) => `| ${cells.map((cell) => cell.replaceAll("|", "\\|")).join(" | ")} |`;
  return [line(head ?? []), line((head ?? []).map(() => "---")), ...rows.map(line)].join("\n") + "\n";
}

async function copy(text: string, control: HTMLButtonElement): Promise<void> {
  await navigator.clipboard.writeText(text);
  const title = control.textContent;
  control.textContent = "Copied";
  setTimeout(() => (control.textContent = title), 1500);
}

/** Sorts the rows of each group by a column; the title of a group stays in its first row. */
function sort(table: HTMLTableElement, column: number, direction: 1 | -1): void {
  for (const body of table.tBodies) {
    const rows = [...body.rows];
    const title = rows[0]?.cells[0]?.tagName === "TH" ? rows[0].cells[0] : null;
    title?.remove();
    const at = title === null ? column : column - 1;
    const key = (row: HTMLTableRowElement) => {
      // Of the paper's change and ours, ours counts.
      const ours = row.cells[at]?.querySelector<HTMLElement>(".ours .text")?.innerText;
      return ours ?? (row.cells[at] === undefined ? "" : textOf(row.cells[at]!));
    };
    rows.sort((a, b) => {
      const [one, other] = [key(a), key(b)];
      const difference = numberIn(one) - numberIn(other);
      return direction * (Number.isNaN(difference) ? one.localeCompare(other) : difference);
    });
    if (title !== null) rows[0]?.prepend(title);
    // Left out where it repeats the row above.
    for (const cell of body.querySelectorAll<HTMLElement>("td[data-text]")) cell.textContent = cell.dataset["text"]!;
    rows.forEach((row, i) => row.classList.toggle("first", i === 0));
    body.append(...rows);
  }
}

function makeSortable(table: HTMLTableElement): void {
  const heads = [...(table.tHead?.rows[0]?.cells ?? [])];
  heads.forEach((head, column) => {
    // The first column has the titles of the groups.
    if (column === 0) return;
    const text = [...head.childNodes].find((node) => node.nodeType === Node.TEXT_NODE && node.textContent?.trim() !== "");
    if (text === undefined) return;
    const title = text.textContent!.trim();
    const control = button(title, title, () => {
      const direction = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      for (const other of heads) other.removeAttribute("aria-sort");
      head.setAttribute("aria-sort", direction === 1 ? "ascending" : "descending");
      sort(table, column, direction);
    });
    control.className = "sort";
    control.title = "Sort";
    head.dataset["text"] = title;
    text.replaceWith(control);
  });
}

/** For each group a matrix of the sweep's points and cases, colored from the least to the greatest number. */
function heatMap(table: HTMLTableElement): HTMLElement {
  const place = document.createElement("div");
  place.className = "matrices";
  for (const body of table.tBodies) {
    const cells = [...body.rows].map((row) => {
      const of = (name: string) => {
        const cell = row.querySelector<HTMLTableCellElement>(`td.${name}`);
        return cell === null ? "" : textOf(cell);
      };
      return { point: of("point"), name: of("case"), text: of("strong") };
    });
    const [points, names] = [[...new Set(cells.map((cell) => cell.point))], [...new Set(cells.map((cell) => cell.name))]];
    const values = cells.map((cell) => numberIn(cell.text)).filter((value) => !Number.isNaN(value));
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const found = document.createElement("table");
    found.className = "matrix";
    const caption = found.createCaption();
    caption.textContent = body.rows[0]?.cells[0] === undefined ? "" : textOf(body.rows[0].cells[0]);
    const head = found.createTHead().insertRow();
    for (const name of ["", ...names]) head.append(Object.assign(document.createElement("th"), { textContent: name, scope: "col" }));
    const rows = found.createTBody();
    for (const point of points) {
      const row = rows.insertRow();
      row.append(Object.assign(document.createElement("th"), { textContent: point, scope: "row" }));
      for (const name of names) {
        const cell = row.insertCell();
        cell.textContent = cells.find((one) => one.point === point && one.name === name)?.text ?? "";
        const share = (numberIn(cell.textContent) - low) / (high - low);
        if (!Number.isNaN(share)) cell.style.setProperty("--share", `${Math.round(55 * share)}%`);
      }
    }
    place.append(found);
  }
  return place;
}

/** Makes a table sortable, and adds its buttons. */
export function enhanceTable(table: HTMLTableElement): void {
  makeSortable(table);
  const asCsv = button("CSV", "Copy the table as CSV", () => void copy(csv(matrix(table)), asCsv));
  const asMarkdown = button("Markdown", "Copy the table as Markdown", () => void copy(markdown(matrix(table)), asMarkdown));
  const bar = document.createElement("div");
  bar.className = "table-buttons";
  bar.append(group("Copy as", [asCsv, asMarkdown]));
  const frame = table.closest<HTMLElement>(".scroll") ?? table;
  const rows = [...table.tBodies].reduce((sum, body) => sum + body.rows.length, 0);
  if (rows > LONG && table.querySelector("td.point") !== null) {
    const map = heatMap(table);
    const control = button("Matrix", "Matrix of the points and cases", () => {
      const shows = control.getAttribute("aria-pressed") !== "true";
      control.setAttribute("aria-pressed", String(shows));
      map.hidden = !shows;
      frame.hidden = shows;
    });
    control.setAttribute("aria-pressed", "false");
    map.hidden = true;
    frame.after(map);
    bar.append(group("Show as", [control]));
  }
  frame.before(bar);
}
