// Which time is shown: the newest row, a chosen one, or one that moves on.

class Timeline {
  constructor() {
    this.slider = document.getElementById("slider");
    this.playButton = document.getElementById("play");
    this.liveButton = document.getElementById("live");
    this.speed = document.getElementById("speed");
    this.at = null; // [s]; null: the newest row
    this.playing = false;
    [this.first, this.last] = [0, 1];
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
    this.playButton.addEventListener("click", () => this.play(!this.playing));
    this.speed.addEventListener("change", () => this.anchor());
    this.liveButton.addEventListener("click", () => this.goLive());
  }

  // another robot: live ones show the newest row, recordings play from their first one
  load(answer) {
    this.live = answer.live;
    this.at = answer.live ? null : answer.first;
    this.play(!answer.live);
  }

  go(seconds) {
    this.at = seconds;
    this.anchor();
  }

  goLive() {
    this.at = this.live ? null : this.last;
    this.playing = false;
  }

  play(on) {
    if (on && (this.at === null || this.at >= this.last)) this.at = this.first;
    this.playing = on;
    this.anchor();
  }

  anchor() {
    this.begin = { at: this.at, now: performance.now() };
  }

  // the time to ask for next
  next() {
    if (this.playing && this.at !== null) {
      const passed = (performance.now() - this.begin.now) / 1000;
      this.at = this.begin.at + passed * Number(this.speed.value);
      if (this.at >= this.last) {
        this.at = this.live ? null : this.last;
        this.playing = false;
      }
    }
    return this.at;
  }

  show(answer) {
    [this.first, this.last] = [answer.first, answer.last];
    this.slider.min = answer.first;
    this.slider.max = Math.max(answer.last, answer.first + 1e-9);
    this.slider.value = answer.at;
    this.playButton.textContent = this.playing ? "Pause" : "Play";
    this.liveButton.textContent = answer.live ? "Live" : "End";
    this.liveButton.classList.toggle("on", answer.live && this.at === null);
    const behind = this.at !== null && answer.live ? `, ${(answer.last - answer.at).toFixed(1)} s ago` : "";
    document.getElementById("time").textContent = `${answer.at.toFixed(3)} s, iteration ${answer.iteration}${behind}`;
  }
}
