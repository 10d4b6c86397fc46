// Histories that never outgrow their cap: the older half is thinned, the newer one stays as it is.

const MOST_POINTS = 3000;

function thin(values: number[]): number[] {
  const half = values.length >> 1;
  return values.filter((_, i) => i >= half || i % 2 === 0);
}

/** Where the base was seen, in the map frame. */
export class Trail {
  x: number[] = [];
  y: number[] = [];

  add(x: number, y: number): void {
    const n = this.x.length;
    if (n > 0 && Math.hypot(this.x[n - 1]! - x, this.y[n - 1]! - y) < 0.01) return;
    this.x.push(x);
    this.y.push(y);
    if (n < MOST_POINTS) return;
    this.x = thin(this.x);
    this.y = thin(this.y);
  }

  clear(): void {
    this.x = [];
    this.y = [];
  }
}

/** Joint positions over time, all joints on one time axis, as plots want them. */
export class JointHistory {
  times: number[] = [];
  readonly positions = new Map<string, (number | null)[]>();

  add(time: number, joints: Record<string, number>): void {
    const newest = this.times.at(-1);
    if (newest !== undefined && time <= newest) return;
    if (Object.keys(joints).length === 0) return;
    for (const name of Object.keys(joints)) {
      if (!this.positions.has(name)) this.positions.set(name, this.times.map(() => null));
    }
    this.times.push(time);
    for (const [name, values] of this.positions) values.push(joints[name] ?? null);
    if (this.times.length <= MOST_POINTS) return;
    this.times = thin(this.times);
    for (const [name, values] of this.positions) {
      const half = values.length >> 1;
      this.positions.set(name, values.filter((_, i) => i >= half || i % 2 === 0));
    }
  }

  /** The server's history replaces what is known of these joints; newer points of our own stay. */
  replace(joints: Record<string, [number, number][]>): void {
    const rows = new Map<number, Record<string, number>>();
    const put = (time: number, name: string, value: number): void => {
      const row = rows.get(time) ?? {};
      row[name] = value;
      rows.set(time, row);
    };
    let newest = -Infinity;
    for (const [name, points] of Object.entries(joints)) {
      for (const [time, value] of points) {
        put(time, name, value);
        newest = Math.max(newest, time);
      }
    }
    this.times.forEach((time, i) => {
      if (time <= newest) return;
      for (const [name, values] of this.positions) if (values[i] != null) put(time, name, values[i]);
    });
    this.times = [];
    this.positions.clear();
    for (const [time, row] of [...rows].sort((a, b) => a[0] - b[0])) this.add(time, row);
  }
}
