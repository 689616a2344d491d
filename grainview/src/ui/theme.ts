// The light or dark theme.

import type { SettingValues } from "../state";

const SYSTEM_DARK = window.matchMedia("(prefers-color-scheme: dark)");

/** Whether the page is dark, by its setting or else as the operating system. */
export function isDark(settings: SettingValues): boolean {
  const theme = settings.get<string>("theme");
  return theme === "dark" || (theme === "auto" && SYSTEM_DARK.matches);
}

export function onSystemThemeChange(listener: () => void): void {
  SYSTEM_DARK.addEventListener("change", listener);
}
