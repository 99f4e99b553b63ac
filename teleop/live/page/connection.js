// WebSocket connection to the live process, with reconnection, heartbeat and detection of missing and old data.

const KIND_TICKS = 1; // first number in the header of a binary message that contains ticks
const CLEAR = 1; // bit in the header: remove the earlier rows
const HEADER = 24; // size of the header before the rows [bytes]
const BEAT = 50; // shortest time between two heartbeats [ms]
const SILENCE = 350; // time without data after which data are reported as missing [ms]
const OLD = 500; // age from which data are reported as old [ms]
const CHECK = 50; // time between two checks for missing and old data [ms]
const CONNECTED = "connected"; // state of a connection that the server has accepted
const DO_NOT_RETRY = 1008; // code with which the server closes a connection that it refuses

export class Connection {
  constructor(view, store) {
    this.view = view;
    this.store = store;
    this.handlers = new Map();
    this.token = new URLSearchParams(location.hash.slice(1)).get("t") || "";
    this.words = "connecting"; // state of the connection as text
    this.expecting = () => false; // returns whether the page expects data at present
    this.fresh = false; // false while the page expects data but receives none, or only old data
    this.isReplay = false;
    this.lastBatch = 0;
    this.roundTrip = NaN;
    this.answered = NaN; // time at which the page sent the newest message that the server has answered [ms]
    this.beatAt = -Infinity; // time of the last heartbeat [ms]
    this.sentAt = NaN; // time at which the newest batch was sent, on the clock of the server [s]
    this.socket = null;
    this.delay = 500;
    setInterval(() => this.#check(), CHECK);
    this.#open();
  }

  on(type, handler) {
    if (!this.handlers.has(type)) this.handlers.set(type, []);
    this.handlers.get(type).push(handler);
  }

  // Send a request. Return false if there is no connection.
  send(message) {
    if (!this.socket || this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  // Whether the page is connected to a live process that has accepted it.
  get isOpen() {
    return this.words === CONNECTED;
  }

  // Upper limit of the age of the newest received data [ms]: the server sent them after it had received the newest
  // message of the page that it has answered. The clocks of the two computers need not agree.
  get age() {
    return performance.now() - this.answered;
  }

  // Time since the newest rows arrived [ms].
  get silence() {
    return performance.now() - this.lastBatch;
  }

  // Whether rows arrive at present, so that only the delay of the connection can be the cause of old data.
  get arrives() {
    return this.silence <= SILENCE;
  }

  #emit(type, message) {
    for (const handler of this.handlers.get(type) || []) handler(message);
  }

  #open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.answered = performance.now(); // all data are answers to this message
      socket.send(JSON.stringify({ type: "hello", token: this.token, view: this.view }));
    };
    socket.onmessage = (event) => this.#receive(event.data);
    socket.onclose = (event) => this.#closed(event);
    this.socket = socket;
  }

  #closed(event) {
    this.#say(event.reason ? `connection refused: ${event.reason}` : "no connection to teleop");
    this.#emit("closed", event);
    if (event.code === DO_NOT_RETRY) return;
    setTimeout(() => this.#open(), this.delay);
    this.delay = Math.min(2 * this.delay, 2000);
  }

  #receive(data) {
    if (typeof data !== "string") return this.#ticks(data);
    const message = JSON.parse(data);
    if (message.type === "echo") {
      this.answered = message.at;
      this.roundTrip = this.age;
    }
    if (message.type === "welcome") {
      this.isReplay = message.kind === "replay";
      this.store.setColumns(message.columns.map((column) => column.name));
      const estimated = message.estimators.flatMap(({ name, further, ...columns }) => [...Object.values(columns), ...Object.values(further)]);
      this.store.awaitInformation(estimated.filter(Number.isFinite), message.thresholds.expected);
      this.delay = 500;
      this.#say(CONNECTED);
    }
    this.#emit(message.type, message);
  }

  #ticks(buffer) {
    const header = new DataView(buffer, 0, HEADER);
    if (header.getUint32(0, true) !== KIND_TICKS) return;
    const rows = header.getUint32(4, true);
    const columns = header.getUint32(8, true);
    if (header.getUint32(12, true) & CLEAR) this.store.clear();
    this.sentAt = header.getFloat64(16, true);
    this.#beat();
    if (rows || this.isReplay) this.lastBatch = performance.now();
    if (rows) this.store.append(new Float64Array(buffer, HEADER, rows * columns), rows, columns);
  }

  #say(words) {
    if (words === this.words) return;
    this.words = words;
    this.#emit("words", words);
  }

  // Confirm the newest data, as an answer to them. A page that receives nothing confirms nothing.
  #beat() {
    const now = performance.now();
    if (now - this.beatAt >= BEAT && this.send({ type: "beat", seen: this.sentAt, at: now })) this.beatAt = now;
  }

  // Set `fresh` to false while the page expects data but receives none, or only old data.
  #check() {
    const open = this.socket.readyState === WebSocket.OPEN;
    if (!this.expecting()) this.lastBatch = performance.now();
    const old = this.age > OLD && this.expecting() && !this.isReplay;
    const fresh = open && this.arrives && !old;
    if (fresh === this.fresh) return;
    this.fresh = fresh;
    this.#emit("fresh", fresh);
  }
}
