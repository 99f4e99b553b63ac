// Show whether k and b can be used, as the program has decided, and why.

const SIGNS = { "can be used": "●", "not yet": "○", "cannot": "✕" };

export class Trust {
  constructor(byId) {
    this.byId = byId;
  }

  // Show the marks of the message `state`. They are empty if no trial has begun.
  show(trust) {
    for (const part of ["k", "b"]) {
      const { mark, reason } = (trust && trust[part]) || { mark: "", reason: "" };
      const box = this.byId(`trust-${part}`);
      const text = mark && `${SIGNS[mark]} ${mark}`;
      if (box.textContent !== text) box.textContent = text;
      box.dataset.mark = mark;
      const why = this.byId(`trust-${part}-reason`);
      if (why.textContent !== reason) why.textContent = reason;
    }
  }
}
