// Give tests and the console of the browser read-only access to the data of the page.

export function publish({ store, connection, status, frames, hand, view }) {
  const access = {
    rows: () => store.count,
    last: (name) => store.last(name),
    series: (name) => {
      const column = store.column(name);
      const values = [];
      for (let row = store.first; column && row < store.count; row++) values.push(column.at(row));
      return values;
    },
    state: () => ({ ...status.state }),
    fresh: () => connection.fresh,
    frameRate: () => frames.rate,
    sentAt: () => connection.sentAt,
    hand: () => ({ ...hand }),
    view: () => ({ span: view.span, time: view.time, follows: view.follows }),
  };
  Object.defineProperty(window, "teleop", { value: Object.freeze(access) });
}
