// Asks the server, or the recording inside this file, shows the answer, asks again: there is never more than one answer on its way.

const BETWEEN_LOOKS = 40; // [ms]
const BETWEEN_CURVES = 110; // [ms]
const RETRY = 1000; // [ms]
const GIVE_UP = 8000; // [ms] for an answer

const token = new URLSearchParams(location.search).get("token");
const byId = (id) => document.getElementById(id);

const sentence = (text) => (/[.?!]$/.test(text) ? text : `${text}.`);

class Page {
  constructor() {
    this.scene = new Scene(byId("scene"));
    this.timeline = new Timeline();
    this.segments = new SegmentList(byId("segments"), (name) => this.choose(name));
    this.fields = new FieldList(byId("fields"), byId("search"), (names) => this.buildCharts(names));
    this.charts = [];
    this.source = null;
    this.key = null;
    this.answer = null; // the last one
    this.looks = 0;
    this.curvesAt = 0;
    this.said = ""; // what a button answered
    byId("halt")?.addEventListener("click", () => this.command("/halt", {}));
    byId("resume")?.addEventListener("click", () => this.command("/resume", { number: this.line().halt?.number }));
    byId("window").addEventListener("change", () => { this.curvesAt = 0; });
    byId("list").addEventListener("click", () => document.body.classList.toggle("list"));
  }

  async post(path, body) {
    if (this.file) return this.file.look(body);
    const answer = await fetch(path, {
      method: "POST",
      headers: { Authorization: `Bearer ${token}` },
      body: JSON.stringify(body),
      signal: AbortSignal.timeout(GIVE_UP),
    });
    if (answer.headers.get("Content-Type").startsWith("text/plain")) throw Error(await answer.text());
    const read = await answer.json();
    if (read.error) throw Error(read.error);
    return read;
  }

  async run() {
    const recording = byId("recording");
    if (recording) this.file = await RecordingInFile.read(recording.textContent);
    for (;;) {
      const begin = performance.now();
      try {
        await this.look();
      } catch (error) {
        this.lost(error);
        await new Promise((done) => setTimeout(done, RETRY));
      }
      this.scene.draw();
      const left = BETWEEN_LOOKS - (performance.now() - begin);
      if (left > 0) await new Promise((done) => setTimeout(done, left));
      await new Promise((done) => requestAnimationFrame(done)); // none while the page is hidden
    }
  }

  async look() {
    const now = performance.now();
    const curves = now - this.curvesAt >= BETWEEN_CURVES;
    if (curves) this.curvesAt = now;
    const asked = { source: this.source, key: this.key, at: this.timeline.next(), curves, window: Number(byId("window").value), seen: this.segments.seen };
    asked.known = Object.fromEntries([...this.scene.robots].map(([name, { key }]) => [name, key]));
    if (this.key !== null) asked.panels = this.fields.chosen;
    const source = this.source;
    const answer = await this.post("/look", asked);
    if (source !== this.source) return; // another one was chosen meanwhile
    ++this.looks;
    this.show(answer);
  }

  show(answer) {
    this.answer = answer;
    this.source = answer.source ?? null;
    this.showButtons(); // first: whatever fails below, they name the robot that they command
    if (answer.new) this.introduce(answer);
    this.showSegments(answer);
    if (answer.at !== undefined) {
      this.timeline.show(answer);
      this.showCurves(answer);
    }
    this.notice(this.problem(answer));
  }

  // the robots of one world in one scene: the chosen one, with its ghost, and the others
  showSegments(answer) {
    const others = answer.others ?? {};
    const drawn = Object.fromEntries(Object.entries(others).map(([name, { shares }]) => [name, shares]));
    if (answer.pose) drawn[this.source] = true;
    this.segments.show(answer.list, this.source, answer.waiting, drawn);
    const poses = { ...others, [this.source]: { pose: answer.pose, scene: this.geometry, key: this.key } };
    const seen = Object.keys(drawn).filter((name) => this.segments.sees(name, drawn[name]));
    this.scene.keep(seen);
    for (const name of seen) {
      const { pose, scene, key } = poses[name];
      const known = this.scene.robots.get(name);
      if (scene && known?.key !== key) this.scene.load(name, scene, key);
      else if (known && known.key !== key) this.scene.remove(name);
      this.scene.show(name, pose, name === this.source && answer.ghost);
    }
    this.scene.choose(this.source);
    byId("no-scene").classList.toggle("above", this.scene.geoms.length > 0);
    const isDrawn = this.scene.gl && (this.geometry || Object.keys(drawn).length);
    document.body.classList.toggle("flat", this.key !== null && !isDrawn);
    byId("ghost-legend").hidden = !this.scene.ghosts().size;
  }

  introduce(answer) {
    this.key = answer.key;
    document.title = `${answer.source} - o80 view`;
    byId("robot").textContent = answer.source;
    const lost = answer.new.scene && !this.scene.gl ? "This browser has no WebGL 2, so there is no 3D view." : "";
    byId("no-scene").textContent = lost || answer.new.no_scene;
    this.timeline.load(answer);
    this.geometry = answer.new.scene;
    [this.units, this.charts] = [answer.new.units, []];
    this.fields.load(answer.new.panels, answer.new.first_panels);
    this.curvesAt = 0;
  }

  buildCharts(names) {
    const there = new Map(this.charts.map((chart) => [chart.name, chart]));
    this.charts = names.slice(0, 12).map((name) => there.get(name) ?? new Chart(name, this.units[name]));
    byId("charts").replaceChildren(...this.charts.map((chart) => chart.box));
    this.curvesAt = 0;
  }

  showCurves(answer) {
    for (const chart of this.charts) {
      if (answer.values[chart.name]) chart.values(answer.values[chart.name]);
      if (answer.curves) chart.show(answer.curves.panels[chart.name], answer.curves, answer.at);
    }
  }

  line() {
    return this.answer?.list.find((line) => line.name === this.source) ?? {};
  }

  showButtons() {
    const line = this.line();
    const halt = byId("halt");
    if (!halt) return; // a recording in a file
    halt.hidden = line.live === false;
    halt.disabled = !(line.live && line.alive);
    halt.textContent = line.live ? `Halt ${line.name}` : "Halt";
    byId("resume").hidden = !(this.answer.control && line.halt);
  }

  problem(answer) {
    if (answer.problem) return answer.problem;
    if (answer.not_finite?.length) return `not finite: ${answer.not_finite.slice(0, 5).join(", ")}`;
    if (answer.overwritten) return "this row was overwritten: the oldest one is shown";
    const line = this.line();
    if (line.halt) return `${sentence(line.halt.text)} Go on with ${answer.control ? "Resume" : `o80 resume ${line.name} ${line.halt.number}`}`;
    if (answer.halted) return "halted";
    return this.said;
  }

  notice(text) {
    if (byId("notice").textContent !== text) byId("notice").textContent = text;
  }

  lost(error) {
    const gone = error instanceof TypeError || error.name === "TimeoutError";
    this.notice(gone ? "No answer: o80 view has ended or is stopped. Trying again." : error.message);
    if (!this.file) byId("halt").disabled = gone && !this.answer;
  }

  async command(path, body) {
    try {
      await this.post(path, { segment: this.line().name, ...body });
      this.said = "";
    } catch (error) {
      this.said = error.message;
      this.notice(error.message);
    }
  }

  choose(name) {
    document.body.classList.remove("list");
    [this.source, this.key, this.said] = [name, null, ""];
    this.geometry = null;
    this.charts = [];
    byId("charts").replaceChildren();
    byId("robot").textContent = name;
    byId("no-scene").textContent = byId("time").textContent = "";
    document.title = `${name} - o80 view`;
    this.showButtons();
  }
}

const page = new Page();
page.run();
