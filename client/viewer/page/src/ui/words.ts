// Numbers as people read them.
const whole = new Intl.NumberFormat('en', { maximumFractionDigits: 0 });

export const count = (n: number | bigint) => whole.format(n);
export const signed = (n: number) => (n > 0 ? `+${count(n)}` : n < 0 ? `−${count(-n)}` : '0');
export const percent = (share: number) => `${Math.round(100 * share)} %`;

export function digits(value: number, most = 3): string {
  if (!Number.isFinite(value)) return '–';
  const places = Math.max(0, most - Math.max(1, Math.floor(Math.log10(Math.abs(value) || 1)) + 1));
  return value.toFixed(places);
}

export function bytes(n: number): string {
  const units = ['B', 'KB', 'MB', 'GB', 'TB'];
  let unit = 0;
  while (n >= 1000 && unit < units.length - 1) {
    n /= 1000;
    unit++;
  }
  return `${digits(n)} ${units[unit]}`;
}

export function mass(kg: number): string {
  if (kg >= 1e4) return `${digits(kg / 1000)} t`;
  if (kg < 0.1) return `${digits(kg * 1000)} g`;
  return `${digits(kg)} kg`;
}

export const plural = (n: number, one: string, many = `${one}s`) => `${count(n)} ${n === 1 ? one : many}`;

// Simulated time: "2:05.3".
export function clockTime(seconds: number): string {
  const minutes = Math.floor(seconds / 60);
  return `${minutes}:${(seconds - 60 * minutes).toFixed(1).padStart(4, '0')}`;
}
