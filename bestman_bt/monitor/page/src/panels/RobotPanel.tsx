// The robot: where it is and believes to be, its map with lidar and path, its joints, what its cameras saw.

import { seconds } from "../describe";
import type { Run } from "../run";
import { JointPlot } from "./JointPlot";
import { RobotMap } from "./RobotMap";

export function RobotPanel({ run }: { run: Run }) {
  void run.beat.value;
  const { base, believed_std: spread, held, diagnostics } = run.robot;
  const known = base !== undefined || run.map.value !== null || run.robot.joints !== undefined;
  return (
    <div class="robot-panel">
      {!known && <p class="empty">This run tells nothing about a robot.</p>}
      {(base !== undefined || run.map.value !== null) && <RobotMap run={run} />}
      <dl class="counts robot-facts">
        {base !== undefined && (
          <>
            <Fact name="x" value={`${base[0].toFixed(2)} m`} />
            <Fact name="y" value={`${base[1].toFixed(2)} m`} />
            <Fact name="Heading" value={`${((base[2] * 180) / Math.PI).toFixed(0)}°`} />
          </>
        )}
        {spread !== undefined && <Fact name="Believed to" value={`±${(spread[0] * 100).toFixed(1)} cm`} />}
        {known && <Fact name="Holds" value={held ?? "nothing"} />}
      </dl>
      <Diagnostics value={diagnostics} />
      {run.robot.joints !== undefined && <JointPlot key={run.id} run={run} />}
      <Pictures run={run} />
    </div>
  );
}

function Fact({ name, value }: { name: string; value: string }) {
  return <div><dt>{name}</dt><dd>{value}</dd></div>;
}

function Diagnostics({ value }: { value: unknown }) {
  if (value === null || value === undefined || typeof value !== "object") return null;
  const rows = Object.entries(value);
  if (rows.length === 0) return null;
  return (
    <details class="scope">
      <summary>Diagnostics <span class="badge">{rows.length}</span></summary>
      <table class="facts">
        <tbody>{rows.map(([name, fact]) => <tr key={name}><th scope="row">{name}</th><td>{typeof fact === "object" ? JSON.stringify(fact) : String(fact)}</td></tr>)}</tbody>
      </table>
    </details>
  );
}

/** Of each camera the newest picture that had been taken by the moment that is shown. */
function Pictures({ run }: { run: Run }) {
  const newest = new Map<string, { time: number; url: string }>();
  for (const picture of run.pictures.value) {
    const known = newest.get(picture.camera);
    if (picture.time <= run.time + 1e-3 && (known === undefined || picture.time >= known.time)) newest.set(picture.camera, picture);
  }
  if (newest.size === 0) return null;
  return (
    <>
      <h3>Pictures</h3>
      <div class="pictures">
        {[...newest].map(([camera, picture]) => (
          <figure key={camera}>
            <a href={picture.url} target="_blank" rel="noreferrer">
              <img src={picture.url} alt={`What ${camera} saw at ${seconds(picture.time)}`} />
            </a>
            <figcaption>{camera} <span class="numbers">{seconds(picture.time)}</span></figcaption>
          </figure>
        ))}
      </div>
    </>
  );
}
