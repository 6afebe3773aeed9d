// What this browser remembers of a coach's choices, apart for each model.

export class Memory {
  constructor(model) {
    this.key = `oarlock-live:${model}`;
    this.values = {};
    try {
      this.values = JSON.parse(localStorage.getItem(this.key)) ?? {};
    } catch {
      // a browser that keeps nothing, or what is no JSON: the defaults hold
    }
  }

  get(name, otherwise) {
    return this.values[name] ?? otherwise;
  }

  set(name, value) {
    this.values[name] = value;
    try {
      localStorage.setItem(this.key, JSON.stringify(this.values));
    } catch {
      // as above: the choice holds until the page is closed
    }
  }
}
