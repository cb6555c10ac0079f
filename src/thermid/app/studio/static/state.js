// What the page knows; every module reads and writes this one object.
export const s = { project: null, stage: null, desk: null, values: {}, run: 0, gas: "air", time: null, window: null, chosen: null, done: [], undone: [], folded: new Set(), ticked: new Set(), view: "tune" };
// what was moved comes back when the page is loaded anew or the stage opened again; it is this tab's alone
const drawer = (stage) => `thermid ${s.project.file} ${stage}`;
export const kept = (stage) => JSON.parse(sessionStorage.getItem(drawer(stage)) || '{"values":{},"done":[],"undone":[]}');
export const keep = (stage, what) => sessionStorage.setItem(drawer(stage), JSON.stringify({ values: what.values, done: what.done.slice(-50), undone: what.undone.slice(-50) }));
export const forget = (stage) => sessionStorage.removeItem(drawer(stage));
