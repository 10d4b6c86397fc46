// The trees that the fake server runs: a handful of steps for tests, fetching a cup, and big ones for measuring.

import { condition, fallback, FAILURE, leaf, reactive, retry, sequence, subtree, succeed, SUCCESS } from "./behavior_tree.mjs";

/** Ten nodes whose states a test can foretell tick by tick. */
export function steps() {
  return sequence("errand", [
    condition("BatteryOk", { name: "battery_ok" }),
    fallback("have_key", [
      condition("HoldsKey", { name: "holds_key", results: [FAILURE], why: "the hand is empty" }),
      retry("try_key", 2, sequence("get_key", [leaf("GoTo", { name: "go_to_hook", ports: { goal: "{hook}" }, ticks: 2 }), leaf("TakeKey", { name: "take_key", ticks: 1, results: [FAILURE, SUCCESS], why: "KEY_SLIPPED: it slipped out of the fingers" })])),
    ]),
    leaf("OpenDoor", { name: "open_door", ticks: 2 }),
    leaf("Rest", { name: "rest", ticks: 1_000_000 }),
  ]);
}

/** As trees/fetch_cup.xml of this project, shortened. */
export function fetchCup() {
  const look = (name, extra = []) => sequence(name, [leaf("LookAt", { ports: { object: "{object}", surface: "{where}" }, ticks: 8 }), leaf("DetectObject", { ports: { object: "{object}" }, ticks: 4 }), ...extra]);
  const pick = sequence("pick", [
    retry("try_stands", 2, sequence("from_one_stand", [
      leaf("FindStandPose", { ports: { object: "{object}", surface: "{where}", stand: "{stand}" }, ticks: 2, then: "stand" }),
      leaf("MoveArm", { ports: { posture: "carry" }, ticks: 18, then: "arm" }),
      leaf("NavigateTo", { ports: { goal: "{stand}" }, ticks: 90, then: "drive" }),
      retry("try_looks", 2, look("look_and_grasp", [
        condition("Reachable", { ports: { object: "{object}" } }),
        leaf("EstimatePose", { ports: { object: "{object}", pose: "{pose}" }, ticks: 10, then: "pose" }),
        succeed("if_it_can", leaf("SecondLook", { ports: { object: "{object}", max_yaw_width: "0.2" }, ticks: 6, results: [FAILURE], why: "NO_VIEW: no second view of cup within reach" })),
        leaf("PlanGrasp", { ports: { object: "{object}", grasps: "{grasps}" }, ticks: 9, then: "grasps" }),
        retry("try_grasps", 3, leaf("Grasp", { ports: { object: "{object}", grasps: "{grasps}" }, ticks: 34, results: [FAILURE, SUCCESS], why: "GRASP_EMPTY: the fingers closed on nothing at 3 mm; next candidate", then: "grasp" })),
      ])),
    ])),
    leaf("Retreat", { ports: { posture: "carry" }, ticks: 16, then: "arm" }),
  ]);
  const place = retry("try_stands", 2, sequence("from_one_stand", [
    leaf("FindStandPose", { ports: { surface: "{surface}", goal: "{goal}", stand: "{stand}" }, ticks: 2, then: "stand" }),
    reactive("carry", [condition("Holding", { ports: { object: "{object}" } }), leaf("NavigateTo", { ports: { goal: "{stand}" }, ticks: 110, then: "drive" })]),
    subtree("PutDown", "put_down", sequence("put_down", [
      leaf("LookAt", { ports: { surface: "{surface}", point: "{goal}" }, ticks: 8 }),
      leaf("FindPlacePose", { ports: { object: "{object}", goal: "{goal}", pose: "{place_pose}" }, ticks: 5 }),
      leaf("PlaceOn", { ports: { object: "{object}", pose: "{place_pose}" }, ticks: 30, then: "arm" }),
      retry("let_go", 3, leaf("Release", { ports: { object: "{object}" }, ticks: 8, then: "release" })),
      leaf("Retreat", { ports: { posture: "carry" }, ticks: 16, then: "arm" }),
    ]), { object: "{object}", surface: "{surface}", goal: "{goal}" }),
  ]));
  const verify = sequence("verify", [retry("try_looks", 2, look("look")), condition("ObjectAt", { ports: { object: "{object}", goal: "{goal}", tolerance: "0.015" } })]);
  return subtree("PickAndPlace", "fetch", retry("pick_and_place", 3, sequence("bring", [
    fallback("have_object", [
      condition("Holding", { ports: { object: "{object}" }, results: [FAILURE], why: "NOT_HELD: the gripper is open" }),
      subtree("Pick", "pick", pick, { object: "{object}", surface: "{source}" }),
    ]),
    subtree("Place", "place", place, { object: "{object}", surface: "{target}", goal: "{goal}" }),
    subtree("Verify", "verify", verify, { object: "{object}", surface: "{target}", goal: "{goal}" }),
  ])), { object: "{object}", source: "{source}", target: "{target}", goal: "{goal}" });
}

/** At least `count` nodes that all take part: subtrees of sequences of short leaves, over and over. */
export function big(count) {
  const areas = Math.max(2, Math.round(Math.sqrt(count) / 4));
  const each = Math.ceil((count - 2) / areas);
  const area = (a) => {
    const steps = Math.ceil((each - 2) / 5);
    return subtree("Area", `area_${a}`, sequence(`work_${a}`, Array.from({ length: steps }, (_, s) =>
      fallback(`step_${a}_${s}`, [
        condition("Done", { name: `done_${a}_${s}`, results: [FAILURE, FAILURE, SUCCESS] }),
        sequence(`do_${a}_${s}`, [leaf("Reach", { name: `reach_${a}_${s}`, ticks: 1 }), leaf("Act", { name: `act_${a}_${s}`, ticks: 2 })]),
      ]))));
  };
  const parallel = { type: "Parallel", name: "all_areas", ports: {}, category: "control", children: Array.from({ length: areas }, (_, a) => area(a)) };
  return { ...sequence("patrol", []), children: [parallel] };
}
