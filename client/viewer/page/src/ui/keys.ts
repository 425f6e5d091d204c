// The keyboard. Fields and sliders keep their own keys.

export type KeyMap = Record<string, (event: KeyboardEvent) => void>;

export function listenToKeys(map: KeyMap): void {
  // What was clicked on with the pointer does not keep the keyboard: space then pauses, rather than click again.
  const letGo = (event: MouseEvent) => {
    const control = (event.target as Element).closest<HTMLElement>('button, summary, input[type=range], input[type=checkbox]');
    if (control && !control.closest('dialog') && event.detail > 0) control.blur();
  };
  window.addEventListener('click', letGo);
  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (document.querySelector('dialog[open]')) return;
    const at = event.target as HTMLElement;
    if (at instanceof HTMLInputElement || at instanceof HTMLSelectElement || at instanceof HTMLTextAreaElement) {
      if (event.key !== 'Escape') return;
      at.blur();
    }
    // Enter and space press the button that has the focus.
    if ((event.key === ' ' || event.key === 'Enter') && at.closest('button, summary')) return;
    const act = map[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act) return;
    event.preventDefault();
    act(event);
  });
}
