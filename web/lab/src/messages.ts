/** Messages of the lab. Errors stay until they are closed. */

import { element } from "../../src/dom";
import { byId } from "./dom";
import type { Message, Model } from "./model";

/** Time for which a message that is not an error is shown, ms. */
const STAY = 8000;
/** Maximum number of messages; a new one replaces the oldest. */
const MOST = 3;

export class Messages {
  readonly #root = byId("messages");

  constructor(model: Model) {
    model.on("message", (message) => this.#show(message));
    model.on("failed", ({ title, time, component, message }) => {
      const others = (model.opened?.systems.length ?? 1) > 1 ? " The other system continues." : "";
      const what = component === "" ? `ended at ${time.toFixed(3)} s` : `${component} failed at ${time.toFixed(3)} s`;
      this.#show({ level: "error", text: `${title}: ${what}: ${message}`, help: `Rewind, or change the setup.${others}` });
    });
  }

  #show({ level, text, help }: Message): void {
    for (const one of [...this.#root.children]) if ((one as HTMLElement).dataset["text"] === text) one.remove();
    const content = element("p", {}, text);
    if (help !== "") content.append(" ", element("span", { className: "help" }, help));
    const close = element("button", { type: "button", className: "plain", "aria-label": "Close the message", onclick: () => message.remove() }, "×");
    const role = level === "error" ? "alert" : "status";
    const message: HTMLElement = element("div", { className: `message ${level}`, role, "data-text": text }, content, close);
    this.#root.append(message);
    while (this.#root.childElementCount > MOST) this.#root.firstElementChild!.remove();
    if (level === "info") setTimeout(() => message.remove(), STAY);
  }
}
