// The browser's own dialog, shown while `open`; Escape and a click beside it close it.

import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { Icon } from "./Icon";

export function Dialog({ open, title, close, wide = false, children }: {
  open: boolean; title: string; close: () => void; wide?: boolean; children: ComponentChildren;
}) {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    if (open && !dialog.current!.open) dialog.current!.showModal();
    if (!open && dialog.current!.open) dialog.current!.close();
  }, [open]);
  return (
    <dialog
      ref={dialog} class={wide ? "wide" : undefined} aria-label={title} onClose={close}
      onClick={(event) => { if (event.target === dialog.current) close(); }}
    >
      {open && (
        <div class="dialog-body">
          <div class="dialog-head">
            <h2>{title}</h2>
            <button type="button" class="tool" aria-label="Close" onClick={close}><Icon name="close" /></button>
          </div>
          {children}
        </div>
      )}
    </dialog>
  );
}
