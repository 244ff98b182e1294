// Entry point of the Web Worker.
import type { Request } from "../protocol";
import { Engine } from "./engine";

const worker = self as unknown as {
  postMessage(message: unknown, transfer: Transferable[]): void;
  onmessage: ((event: { data: Request }) => void) | null;
};
const engine = new Engine((message, transfer) => worker.postMessage(message, transfer));
worker.onmessage = ({ data }) => engine.receive(data);
