/** Recorded signals in full resolution, from the files beside the page. Only a page on a web server can read them. */

/** If less than this share of the abscissa is shown, lines are drawn from the recorded signals. */
export const CLOSE = 0.5;

type Columns = Map<string, number[]>;

const files = new Map<string, Promise<Columns>>();

async function read(file: string): Promise<Columns> {
  const response = await fetch(file);
  if (!response.ok) throw new Error(`${file}: ${response.status}`);
  const [head = "", ...lines] = (await response.text()).trimEnd().split("\n");
  const rows = lines.map((line) => line.split(","));
  return new Map(head.split(",").map((name, i) => [name, rows.map((row) => Number(row[i]))]));
}

export const isReadable = location.protocol.startsWith("http");

/** Returns times and values of a signal; null if the file does not exist. */
export async function samples(file: string, signal: string): Promise<{ times: number[]; values: number[] } | null> {
  let columns = files.get(file);
  if (columns === undefined) files.set(file, (columns = read(file)));
  try {
    const found = await columns;
    const [times, values] = [found.get("time"), found.get(signal)];
    return times === undefined || values === undefined ? null : { times, values };
  } catch {
    return null;
  }
}
