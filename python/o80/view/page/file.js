// What the server answers, from the recording inside this file.

const KINDS = { f4: Float32Array, f8: Float64Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, i4: Int32Array };
const STRETCHES = 400; // of a curve, about one for each pixel of its width
const MAX_PLANS = 30; // of chunks, the newest ones

// the last index whose number is at most `value`; at least 0
function placeOf(numbers, value) {
  let [low, high] = [0, numbers.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (numbers[middle] <= value) low = middle;
    else high = middle - 1;
  }
  return low;
}

function summed(steps, Kind = Uint32Array, scale = 1) {
  const found = new Kind(steps.length);
  let sum = 0;
  for (let i = 0; i < steps.length; ++i) found[i] = (sum += steps[i]) * scale;
  return found;
}

class RecordingInFile {
  static async read(text) {
    const stream = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream("gzip"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    const begin = 4 + new DataView(bytes.buffer).getUint32(0, true);
    const array = ([place, count, kind]) => {
      const size = KINDS[kind].BYTES_PER_ELEMENT;
      const found = new Uint8Array(count * size);
      for (let byte = 0; byte < size; ++byte) {
        for (let i = 0; i < count; ++i) found[i * size + byte] = bytes[begin + place + byte * count + i];
      }
      return new KINDS[kind](found.buffer);
    };
    const head = new TextDecoder().decode(bytes.subarray(4, begin));
    return new RecordingInFile(JSON.parse(head, (_, value) => (Array.isArray(value?.array) ? array(value.array) : value)));
  }

  constructor(sources) {
    this.sources = new Map(sources.map((source) => [source.line.name, source]));
    for (const source of sources) {
      source.times = summed(source.times, Float64Array, 1e-6);
      source.ticks = summed(source.ticks);
      for (const planned of Object.values(source.planned)) planned[0] = summed(planned[0]);
      source.tickTimes = Float64Array.from(source.ticks, (row) => source.times[row]);
      for (const parts of Object.values(source.columns)) {
        for (const column of Object.values(parts)) column[0] = summed(column[0]);
      }
    }
  }

  look(query) {
    const source = this.sources.get(query.source) ?? [...this.sources.values()].find((each) => each.opened);
    const at = query.at ?? (query.key === source.key ? source.last : source.first);
    const tick = placeOf(source.tickTimes, Math.min(Math.max(at, source.first), source.last));
    const panels = query.panels ?? source.new.first_panels;
    const answer = {
      control: false,
      list: [...this.sources.values()].map(({ line }) => line),
      source: source.line.name,
      key: source.key,
      live: false,
      first: source.first,
      last: source.last,
      at: source.tickTimes[tick],
      iteration: source.iterations[tick],
      halted: source.halted[tick],
      pose: this.poseAt(source, "pose", tick),
      ghost: this.poseAt(source, "ghost", tick),
      others: {},
      values: {},
    };
    if (query.key !== source.key) answer.new = source.new;
    for (const [name, { shares, ticks }] of Object.entries(source.others)) {
      if (ticks[tick] < 0) continue;
      const other = this.sources.get(name);
      answer.others[name] = { shares, key: other.key, scene: other.new.scene, pose: this.poseAt(other, "pose", ticks[tick]) };
    }
    for (const panel of panels) answer.values[panel] = this.valuesAt(source, panel, source.ticks[tick]);
    if (query.curves) answer.curves = this.curves(source, panels, query.window, at);
    return answer;
  }

  poseAt(source, kind, tick) {
    const [numbers, ticks] = [source[kind], source.ticks.length];
    return numbers && Float32Array.from({ length: numbers.length / ticks }, (_, i) => numbers[i * ticks + tick]);
  }

  valuesAt(source, panel, row) {
    const found = Object.entries(source.columns[panel] ?? {}).map(([part, [rows, values]]) => {
      const value = values[placeOf(rows, row)];
      const label = source.new.labels[panel]?.[value];
      return [part, label ?? (Number.isFinite(value) ? value : String(value))];
    });
    return Object.fromEntries(found);
  }

  curves(source, panels, window, at) {
    const end = Math.max(source.first, Math.min(at + window / 2, source.last));
    const begin = Math.max(source.first, end - window);
    const found = {};
    let ahead = end;
    for (const panel of panels) {
      found[panel] = {};
      for (const [part, [rows, values]] of Object.entries(source.columns[panel] ?? {})) {
        const [low, high] = [placeOf(rows, placeOf(source.times, begin)), placeOf(rows, placeOf(source.times, end)) + 1];
        const drawn = drawnRows(values.subarray(low, high));
        found[panel][part] = [
          Float32Array.from(drawn, (i) => source.times[rows[low + i]] - begin),
          Float32Array.from(drawn, (i) => values[low + i]),
        ];
      }
      if (!source.planned[panel]) continue;
      const [firsts, times, places] = source.planned[panel];
      const began = Array.from(firsts.keys()).filter((plan) => times[firsts[plan]] >= begin && times[firsts[plan]] <= end);
      const [seconds, values] = [[], []];
      for (const plan of began.slice(-MAX_PLANS)) {
        const last = firsts[plan + 1] ?? times.length;
        for (let i = firsts[plan]; i < last; ++i) {
          seconds.push(times[i] - begin);
          values.push(places[i]);
        }
        seconds.push(0);
        values.push(NaN); // a gap
        ahead = Math.max(ahead, times[last - 1]);
      }
      if (began.length) found[panel].planned = [Float32Array.from(seconds), Float32Array.from(values)];
    }
    const marks = source.marks.filter(([seconds]) => seconds >= begin && seconds <= end);
    return { begin, end: Math.min(ahead, end + window / 3), panels: found, marks: marks.map(([seconds, text]) => [seconds - begin, text]).slice(-50) };
  }
}

// of each stretch the first, lowest, highest and last, in their order
function drawnRows(values) {
  const step = Math.ceil(values.length / STRETCHES);
  if (step <= 4) return Array.from(values.keys());
  const found = new Set();
  for (let first = 0; first < values.length; first += step) {
    const last = Math.min(first + step, values.length) - 1;
    let [low, high] = [first, first];
    for (let i = first; i <= last; ++i) {
      if (!(values[i] >= values[low])) low = i;
      if (!(values[i] <= values[high])) high = i;
    }
    for (const i of [first, low, high, last].sort((a, b) => a - b)) found.add(i);
  }
  return [...found];
}
