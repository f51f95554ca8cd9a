// The form of an attack: its kinds and parameters explained, and checked by the server while one types.
import { arrow, make } from "./looks.js";

const CHECK_MS = 200;

export class AttackForm {
  constructor(command, foreseen) {
    this.command = command;
    this.foreseen = foreseen;
    this.at = (id) => document.getElementById(id);
    this.form = this.at("attack");
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.order("start");
    });
    this.form.addEventListener("input", (event) => {
      if (event.target.id !== "kind") this.later();
    });
    this.at("kind").addEventListener("change", () => this.describe());
    this.at("change").addEventListener("click", () => this.order("change"));
    this.at("stop").addEventListener("click", () => this.order("stop"));
    this.at("ahead").addEventListener("click", () => this.ahead(false));
    this.at("worst").addEventListener("click", () => this.ahead(true));
    this.at("forget").addEventListener("click", () => this.foreseen(null));
  }

  build(outline) {
    this.kinds = outline.attacks;
    this.acts = outline.can.includes("attack");
    this.form.hidden = outline.attacks.length === 0;
    this.at("whatif").hidden = !outline.can.includes("whatif");
    for (const id of ["start", "change", "stop"]) this.at(id).hidden = !this.acts;
    this.at("attack-title").textContent = this.acts ? "Attack this link" : "An attack on this link";
    this.at("length-row").hidden = !this.acts;
    if (this.form.hidden) return;
    const before = this.at("kind").value;
    this.at("kind").replaceChildren(...this.kinds.map((one) => make("option", { value: one.name }, one.name)));
    if (this.kinds.some((one) => one.name === before)) this.at("kind").value = before;
    else this.describe();
  }

  describe() {
    const kind = this.kinds.find((one) => one.name === this.at("kind").value);
    this.at("does").textContent = `${kind.does} The attacker must know: ${kind.knows}.`;
    this.at("more").value = "";
    this.at("more").placeholder = kind.links.length > 1 ? `needs several, as in ${kind.links.slice(1).join(" ")}` : "none, or as in 3-4 2-4";
    this.at("parameters").replaceChildren(
      ...kind.parameters.map((one) =>
        make("label", {}, make("span", {}, one.name), make("input", { name: one.name, value: one.example, placeholder: one.default, spellcheck: "false" }), make("small", {}, one.means)),
      ),
    );
    this.later();
  }

  choose(link) {
    this.link = link;
    this.later();
  }

  show(attacked, calibrating) {
    this.at("change").disabled = this.at("stop").disabled = !attacked;
    if (this.calibrating && !calibrating) this.later();
    this.calibrating = calibrating;
  }

  message(action) {
    const fields = [...this.at("parameters").querySelectorAll("input")].map((one) => [one.name, one.value]);
    const length = Number(this.at("duration").value.trim().replace(",", ".") || 0);
    return {
      kind: "attack",
      action,
      links: [this.link, ...this.at("more").value.split(/[\s,]+/).filter(Boolean)],
      attack: this.at("kind").value,
      parameters: Object.fromEntries(fields),
      duration_sec: Number.isFinite(length) ? length : -1,
    };
  }

  later() {
    clearTimeout(this.timer);
    if (this.link && this.acts) this.timer = setTimeout(() => this.order("check"), CHECK_MS);
  }

  async ahead(worst) {
    const { links, attack, parameters } = this.message("check");
    for (const id of ["ahead", "worst"]) this.at(id).disabled = true;
    const found = await this.command({ kind: "whatif", worst, links, attack, parameters, horizon_sec: Number(this.at("horizon").value) });
    for (const id of ["ahead", "worst"]) this.at(id).disabled = false;
    if (found.kind === "forecast") {
      this.at("verdict").textContent = this.at("verdict").className = "";
      this.foreseen(found);
    } else this.say(found, "what if");
  }

  async order(action) {
    const message = this.message(action);
    if (message.duration_sec < 0 || message.duration_sec > 1e6) {
      this.say({ ok: false, text: "length: expected seconds, or nothing for until stopped" }, action);
      return;
    }
    clearTimeout(this.timer);
    const turn = (this.turn = (this.turn ?? 0) + 1);
    const reply = await this.command(message);
    if (turn === this.turn) this.say(reply, action);
  }

  say(reply, action) {
    const verdict = this.at("verdict");
    verdict.className = reply.ok ? "yes" : "no";
    verdict.textContent = reply.ok && action === "check" ? `can start on ${arrow(this.link)}` : reply.text;
    for (const one of this.at("parameters").querySelectorAll("input")) {
      const blamed = !reply.ok && new RegExp(`\\b${one.name}\\b|${one.name.replaceAll("_", "-")}`).test(reply.text);
      one.classList.toggle("wrong", blamed);
      one.setAttribute("aria-invalid", String(blamed));
    }
    if (this.acts) this.at("start").disabled = !reply.ok && action === "check";
  }
}
