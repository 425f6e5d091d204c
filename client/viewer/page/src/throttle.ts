// Not more often than once in `ms`; the newest value is never lost, only those before it.
export function throttled<T>(send: (value: T) => void, ms: number): (value: T) => void {
  let timer = 0;
  let sentAt = -Infinity;
  let newest: T;
  const now = () => {
    timer = 0;
    sentAt = performance.now();
    send(newest);
  };
  return (value) => {
    newest = value;
    if (timer) return;
    const wait = sentAt + ms - performance.now();
    if (wait > 0) timer = window.setTimeout(now, wait);
    else now();
  };
}
