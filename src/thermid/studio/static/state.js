// What the page knows; every module reads and writes this one object.
export const s = { project: null, stage: null, desk: null, values: {}, run: 0, gas: "air", time: null, window: null, chosen: null, done: [], undone: [], folded: new Set(), ticked: new Set(), view: "tune" };
