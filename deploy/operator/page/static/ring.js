/** Buffers of bounded size for what happened lately. */

/** Rows of numbers; the newest ones replace the oldest. */
export class Rows {
  /** @param {number} capacity rows @param {number} width numbers in a row */
  constructor(capacity, width) {
    this._capacity = capacity;
    this._width = width;
    this._data = new Float64Array(capacity * width);
    this.clear();
  }

  clear() {
    this._next = 0;
    this.length = 0;
  }

  /** @param {ArrayLike<number>} row */
  push(row) {
    for (let column = 0; column < this._width; column += 1) {
      this._data[this._next * this._width + column] = row[column] ?? NaN;
    }
    this._next = (this._next + 1) % this._capacity;
    this.length = Math.min(this.length + 1, this._capacity);
  }

  /** A number by row, 0 is the oldest, and column. */
  at(row, column) {
    const index = (this._next - this.length + row + this._capacity) % this._capacity;
    return this._data[index * this._width + column];
  }

  /** The first row whose first number is at least `value`; rows are in ascending order of it. */
  from(value) {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.at(middle, 0) < value) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

/** The values of something that changes at times: [time, value] at each change. */
export class Changes {
  /** @param {number} span time that is kept @param {number} capacity changes that are kept */
  constructor(span, capacity = 400) {
    this._span = span;
    this._capacity = capacity;
    this.clear();
  }

  clear() {
    this.items = [];
  }

  push(time, value) {
    if (this.items.at(-1)?.[1] !== value) this.items.push([time, value]);
    // The change before the span gives the value at its begin.
    while (this.items.length > this._capacity || this.items[1]?.[0] < time - this._span) this.items.shift();
  }
}
