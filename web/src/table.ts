/** Tables: sorting, copying, lists on narrow screens, and a colored matrix for long tables. */

import { button, element, group, toggle } from "./dom";

/** Tables with more rows than this can be shown as a matrix. */
const LONG = 40;

function textOf(cell: HTMLTableCellElement): string {
  return cell.dataset["text"] ?? (cell.innerText ?? "").replace(/\s+/g, " ").trim();
}

/** Superscript digits, as in 10⁻⁵. */
const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** Returns the number at the beginning of a text; NaN if there is none. */
export function numberIn(text: string): number {
  const found = /^(?:over )?([+−-]?\d+(?:\.\d+)?)(?:[eE]([−+-]?\d+)|×10(⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹]+))?/.exec(text.trim());
  if (found === null) return NaN;
  const raised = [...(found[3] ?? "0")].map((letter) => (letter === "⁻" ? "-" : RAISED.includes(letter) ? RAISED.indexOf(letter) : letter));
  return Number(`${found[1]}e${found[2] ?? raised.join("")}`.replaceAll("−", "-"));
}

/** Compares two texts. Numbers come first, by size, then other texts alphabetically, then empty texts. */
function compare(one: string, other: string, direction: 1 | -1): number {
  const rank = (text: string) => (/^[–-]?$/.test(text) ? 2 : Number.isNaN(numberIn(text)) ? 1 : 0);
  const [first, second] = [rank(one), rank(other)];
  if (first !== second) return first - second;
  return direction * (first === 0 ? numberIn(one) - numberIn(other) : one.localeCompare(other, "en", { numeric: true }));
}

/** Whether the first cell of a group of rows is its title. */
function isGrouped(table: HTMLTableElement): boolean {
  return table.querySelector("tbody th[rowspan]") !== null;
}

/** Returns the titles and the rows as texts. A cell that spans several rows, and the title of a group, are repeated in each row. */
function matrix(table: HTMLTableElement): string[][] {
  const head = [...(table.tHead?.rows[0]?.cells ?? [])].map(textOf);
  const grouped = isGrouped(table);
  const group = table.dataset["group"];
  const rows = [...table.tBodies].flatMap((body) => {
    let first = "";
    return [...body.rows].flatMap((row) => {
      const cells = [...row.cells];
      if (cells[0]?.tagName === "TH" && (grouped || row.className === "group")) first = textOf(cells[0]);
      if (row.className === "group") return [];
      const texts = cells.flatMap((cell) => [textOf(cell), ...Array.from({ length: cell.colSpan - 1 }, () => "")]);
      return [group !== undefined || (grouped && cells[0]?.tagName !== "TH") ? [first, ...texts] : texts];
    });
  });
  return [group === undefined ? head : [group, ...head], ...rows];
}

function csv(rows: string[][]): string {
  const quoted = (cell: string) => (/[",\n]/.test(cell) ? `"${cell.replaceAll('"', '""')}"` : cell);
  return rows.map((row) => row.map(quoted).join(",")).join("\n") + "\n";
}

function markdown([head, ...rows]: string[][]): string {
  const line = (cells: string[]) => `| ${cells.map((cell) => cell.replaceAll("|", "\\|")).join(" | ")} |`;
  return [line(head ?? []), line((head ?? []).map(() => "---")), ...rows.map(line)].join("\n") + "\n";
}

async function copy(text: string, control: HTMLButtonElement): Promise<void> {
  await navigator.clipboard.writeText(text);
  const title = control.textContent;
  control.textContent = "Copied";
  setTimeout(() => (control.textContent = title), 1500);
}

/** Sorts the rows of each group by a column; null restores the original order. A group's title stays in its first row, a summary in its last. */
function sort(table: HTMLTableElement, column: number | null, direction: 1 | -1): void {
  const grouped = isGrouped(table);
  for (const body of table.tBodies) {
    const all = [...body.rows];
    const first = all.filter((row) => row.className === "group");
    const last = all.filter((row) => row.classList.contains("summary"));
    const rows = all.filter((row) => !first.includes(row) && !last.includes(row));
    const title = grouped && rows[0]?.cells[0]?.tagName === "TH" ? rows[0].cells[0] : null;
    title?.remove();
    const at = column === null ? 0 : grouped ? column - 1 : column;
    const key = (row: HTMLTableRowElement) => {
      // A cell that contains a change from the paper and from our results is sorted by our results.
      const ours = row.cells[at]?.querySelector<HTMLElement>(".ours .text")?.innerText;
      return ours ?? (row.cells[at] === undefined ? "" : textOf(row.cells[at]!));
    };
    const keys = new Map(rows.map((row) => [row, key(row)]));
    const given = (row: HTMLTableRowElement) => Number((row.dataset["given"] ??= String(rows.indexOf(row))));
    rows.forEach(given);
    rows.sort((a, b) => (column === null ? given(a) - given(b) : compare(keys.get(a)!, keys.get(b)!, direction)));
    if (title !== null) rows[0]?.prepend(title);
    // The text of a cell is omitted if it repeats the row above; sorting makes it visible again.
    for (const cell of body.querySelectorAll<HTMLElement>("td[data-text], th[scope=row][data-text]")) cell.textContent = cell.dataset["text"]!;
    if (grouped) rows.forEach((row, i) => row.classList.toggle("first", i === 0));
    body.append(...first, ...rows, ...last);
  }
}

/** Makes the column titles buttons that sort, and returns a list for narrow screens, on which the titles are hidden. */
function makeSortable(table: HTMLTableElement): HTMLElement {
  const heads = [...(table.tHead?.rows[0]?.cells ?? [])];
  const choice = element("select", { "aria-label": "Sort by" }, new Option("as given", ""));
  const by = (column: number | null, direction: 1 | -1) => {
    for (const other of heads) other.removeAttribute("aria-sort");
    if (column !== null) heads[column]?.setAttribute("aria-sort", direction === 1 ? "ascending" : "descending");
    choice.value = column === null ? "" : `${column} ${direction}`;
    sort(table, column, direction);
  };
  const grouped = isGrouped(table);
  heads.forEach((head, column) => {
    // The first column can contain the titles of groups.
    if (column === 0 && grouped) return;
    const text = [...head.childNodes].find((node) => node.nodeType === Node.TEXT_NODE && node.textContent?.trim() !== "");
    if (text === undefined) return;
    const title = text.textContent!.trim();
    const control = button(title, () => by(column, head.getAttribute("aria-sort") === "ascending" ? -1 : 1));
    Object.assign(control, { className: "sort", title: "Sort" });
    head.dataset["text"] = title;
    text.replaceWith(control);
    choice.append(new Option(`${title}, rising`, `${column} 1`), new Option(`${title}, falling`, `${column} -1`));
  });
  choice.addEventListener("change", () => {
    const [column = "", direction] = choice.value.split(" ");
    by(column === "" ? null : Number(column), direction === "-1" ? -1 : 1);
  });
  const place = group("Sort by", [choice]);
  place.classList.add("sort-choice");
  return place;
}

/** Adds the column titles to the cells; a narrow screen shows them beside the cells instead of above the columns. */
export function label(table: HTMLTableElement): void {
  const titles = [...(table.tHead?.rows[0]?.cells ?? [])].map(textOf);
  for (const row of [...table.tBodies].flatMap((body) => [...body.rows])) {
    let column = 0;
    for (const cell of row.cells) {
      const title = titles[column];
      if (cell.tagName === "TD" && title !== undefined && title !== "" && textOf(cell) !== "") cell.dataset["label"] ??= title;
      column += cell.colSpan;
    }
  }
  table.classList.add("is-labeled");
}

/** A number in a sweep, and its position in a matrix. */
interface Place {
  title: string;
  row: string;
  column: string;
  text: string;
}

/** Returns the numbers of a group of rows, by matrix. A matrix has the points of the sweep as rows and the cases as columns; in a sweep
 * over two parameters, each case has a matrix with the values of both parameters. */
function places(body: HTMLTableSectionElement): Map<string, Place[]> {
  const metric = body.rows[0]?.cells[0] === undefined ? "" : textOf(body.rows[0].cells[0]);
  const found = [...body.rows].map((row) => {
    const cell = (name: string) => row.querySelector<HTMLTableCellElement>(`td.${name}`);
    const of = (name: string) => (cell(name) === null ? "" : textOf(cell(name)!));
    const { row: across, column } = cell("point")?.dataset ?? {};
    const text = of("strong");
    if (across === undefined || column === undefined) return { title: metric, row: of("point"), column: of("case"), text };
    return { title: `${metric}, ${of("case")}`, row: across, column, text };
  });
  const titles = [...new Set(found.map((place) => place.title))];
  return new Map(titles.map((title) => [title, found.filter((place) => place.title === title)]));
}

/** Makes matrices from the numbers of a sweep, each with colors from its smallest to its largest number. */
function heatMap(table: HTMLTableElement): HTMLElement {
  const all = element("div", { className: "matrices" });
  for (const [title, cells] of [...table.tBodies].flatMap((body) => [...places(body)])) {
    const [rowTitles, columnTitles] = [[...new Set(cells.map((cell) => cell.row))], [...new Set(cells.map((cell) => cell.column))]];
    const values = cells.map((cell) => numberIn(cell.text)).filter((value) => !Number.isNaN(value));
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const head = element("tr", {}, element("td"), ...columnTitles.map((name) => element("th", { scope: "col" }, name)));
    const rows = rowTitles.map((name) => {
      const values = columnTitles.map((column) => {
        const text = cells.find((one) => one.row === name && one.column === column)?.text ?? "";
        const cell = element("td", {}, text);
        const share = high > low ? (numberIn(text) - low) / (high - low) : NaN;
        if (!Number.isNaN(share)) cell.style.setProperty("--share", `${Math.round(55 * share)}%`);
        return cell;
      });
      return element("tr", {}, element("th", { scope: "row" }, name), ...values);
    });
    const found = element("table", { className: "matrix" }, element("caption", {}, title), element("thead", {}, head), element("tbody", {}, ...rows));
    all.append(element("div", { className: "scroll", tabIndex: 0 }, found));
  }
  return all;
}

/** Turns a table into a list on narrow screens; result tables can also be sorted and copied. */
export function enhanceTable(table: HTMLTableElement): void {
  // In a table with group titles, the cells already have labels.
  if (!isGrouped(table)) label(table);
  if (!table.matches(".headline, .results")) return;
  const choice = makeSortable(table);
  const asCsv = button("CSV", () => void copy(csv(matrix(table)), asCsv), "Copy the table as CSV");
  const asMarkdown = button("Markdown", () => void copy(markdown(matrix(table)), asMarkdown), "Copy the table as Markdown");
  const count = [...table.tBodies].reduce((sum, body) => sum + body.rows.length, 0);
  // A single row cannot be sorted.
  const bar = element("div", { className: "table-buttons" }, ...(count > 1 ? [choice] : []), group("Copy as", [asCsv, asMarkdown]));
  const frame = table.closest<HTMLElement>(".scroll") ?? table;
  if (count > LONG && table.querySelector("td.point") !== null) {
    const map = heatMap(table);
    const control = toggle("Matrix", "Matrix of the points and cases", false, (shows) => {
      map.hidden = !shows;
      frame.hidden = shows;
    });
    map.hidden = true;
    frame.after(map);
    bar.append(group("Show as", [control]));
  }
  frame.before(bar);
}
