// How many panels fit beside the tree.

import { signal } from "@preact/signals";

export const PHONE = 720;
const TWO_COLUMNS = 1680;
const THREE_COLUMNS = 2300;

function count(): 1 | 2 | 3 {
  return innerWidth >= THREE_COLUMNS ? 3 : innerWidth >= TWO_COLUMNS ? 2 : 1;
}

export const columns = signal(count());
export const phone = signal(innerWidth < PHONE);

addEventListener("resize", () => {
  columns.value = count();
  phone.value = innerWidth < PHONE;
});
