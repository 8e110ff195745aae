// The list of segments, each with a box that shows it in the scene or hides it, and the list of fields that can be drawn.

class SegmentList {
  constructor(box, choose) {
    this.box = box;
    this.choose = choose;
    this.rows = new Map();
    this.seen = {}; // what the user has chosen to see in the scene, or not
  }

  // drawn: by name, whether a robot is in the scene unless the user decides
  show(lines, chosen, waiting, drawn) {
    const names = lines.map((line) => line.name);
    if (names.join("\n") !== [...this.rows.keys()].join("\n")) this.build(names, waiting);
    for (const line of lines) {
      const { button, eye } = this.rows.get(line.name);
      this.fill(button, line, line.name === chosen);
      eye.style.visibility = drawn[line.name] === undefined ? "hidden" : "visible";
      eye.checked = this.sees(line.name, drawn[line.name]);
    }
  }

  sees(name, unlessTold) {
    return this.seen[name] ?? unlessTold;
  }

  build(names, waiting) {
    this.rows = new Map();
    for (const name of names) {
      const button = element("button", "", "segment");
      button.addEventListener("click", () => this.choose(name));
      const eye = element("input", "", "eye");
      eye.type = "checkbox";
      eye.title = `${name} in the scene`;
      eye.addEventListener("change", () => { this.seen[name] = eye.checked; });
      const row = element("div", "", "row");
      row.append(eye, button);
      this.rows.set(name, { button, eye, row });
    }
    const rows = [...this.rows.values()].map(({ row }) => row);
    this.box.replaceChildren(...(names.length ? rows : [element("p", waiting)]));
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
