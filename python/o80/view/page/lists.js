// The list of segments, and the list of fields that can be drawn.

class SegmentList {
  constructor(box, choose) {
    this.box = box;
    this.choose = choose;
    this.rows = new Map();
  }

  show(lines, chosen, waiting) {
    const names = lines.map((line) => line.name);
    if (names.join("\n") !== [...this.rows.keys()].join("\n")) this.build(names, waiting);
    for (const line of lines) this.fill(this.rows.get(line.name), line, line.name === chosen);
  }

  build(names, waiting) {
    this.rows = new Map();
    for (const name of names) {
      const button = element("button", "", "segment");
      button.addEventListener("click", () => this.choose(name));
      this.rows.set(name, button);
    }
    this.box.replaceChildren(...(names.length ? this.rows.values() : [element("p", waiting)]));
  }

  fill(button, line, chosen) {
    const facts = [line.rate];
    if (line.live && line.overruns !== undefined) facts.push(`${line.overruns} overruns`);
    if (line.missed) facts.push(`${line.missed} missed`);
    if (line.rows !== undefined) facts.push(`${line.rows} rows`);
    if (line.age) facts.push(`last row ${line.age} ago`);
    const texts = [
      line.robot && line.robot !== line.name ? line.robot : "",
      facts.filter(Boolean).join(", "),
      line.halt ? line.halt.text : "",
      line.problem || "",
    ];
    const said = JSON.stringify([line.state, texts, chosen]);
    if (button.said === said) return;
    button.said = said;
    button.classList.toggle("chosen", chosen);
    button.replaceChildren(element("span", line.state, `state ${line.state}`), element("b", line.name));
    texts.forEach((text, i) => {
      if (text) button.append(element("small", text, i > 1 ? "problem" : ""));
    });
  }
}

class FieldList {
  constructor(box, search, changed) {
    this.box = box;
    this.search = search;
    this.changed = changed;
    this.names = [];
    this.chosen = [];
    search.addEventListener("input", () => this.build());
  }

  load(names, first) {
    this.names = names;
    const kept = this.chosen.filter((name) => names.includes(name));
    this.chosen = kept.length ? kept : first;
    this.build();
    this.changed(this.chosen);
  }

  build() {
    const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
    const matches = (name) => words.every((word) => name.toLowerCase().includes(word));
    const shown = this.names.filter((name) => (words.length ? matches(name) : true)).slice(0, 200);
    this.box.replaceChildren(...shown.map((name) => this.line(name)));
    const more = this.names.filter(matches).length - shown.length;
    if (more > 0) this.box.append(element("small", `and ${more} more: type to find them`));
  }

  line(name) {
    const label = element("label");
    const box = element("input");
    box.type = "checkbox";
    box.checked = this.chosen.includes(name);
    box.addEventListener("change", () => {
      const others = this.chosen.filter((each) => each !== name);
      this.chosen = box.checked ? [...others, name] : others;
      this.changed(this.chosen);
    });
    label.append(box, ` ${name}`);
    label.title = name;
    return label;
  }
}
