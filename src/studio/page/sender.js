// Changes of a drag on their way to the server, and its word on their way back.

import { send } from './socket.js';

const WAIT_MS = 100; // between two messages
const SETTLES_MS = 500; // after them the server's word counts again, and a new change is a new step of undo

// Sends some of many changes, and always the last one; the changes of one drag are one for undo.
export function makeSender(type) {
  let next = null;
  let timer = 0;
  let last = -Infinity;
  const post = () => {
    clearTimeout(timer);
    timer = 0;
    if (!next) return;
    send({ type, ...next, goes_on: performance.now() - last < SETTLES_MS });
    last = performance.now();
    next = null;
    timer = setTimeout(post, WAIT_MS);
  };
  return {
    begin: () => {
      if (next) post();
      last = -Infinity;
    },
    push: (change) => {
      next = change;
      if (!timer) post();
    },
    // A hand that rests in the midst of a drag goes on with it later.
    hold: () => {
      if (last > -Infinity) last = performance.now();
    },
    isBusy: () => performance.now() - last < SETTLES_MS,
  };
}

// Hands on the server's last word once nothing is under way: what comes back in the midst of a drag is older than what the hand says.
export function whenSettled(isBusy, take) {
  let told = null;
  let timer = 0;
  const settle = () => {
    clearTimeout(timer);
    if (!told) return;
    if (isBusy()) {
      timer = setTimeout(settle, SETTLES_MS);
      return;
    }
    const word = told;
    told = null;
    take(word);
  };
  return (word) => {
    told = word;
    settle();
  };
}
