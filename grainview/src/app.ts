// The app: brings source, stage, settings and the parts of the page together.

import { copyAddress, lookAs, lookText } from "./address";
import { Choosing } from "./choosing";
import { Frames } from "./data/frames";
import { fieldDirection, type Known } from "./data/quantities";
import type { Manifest, Series, Source } from "./data/types";
import { headerButtons, type Layout } from "./layout";
import { tellRun } from "./live";
import { Picture } from "./picture";
import { Player } from "./player";
import type { Stage } from "./scene/stage";
import { DARK, LIGHT, World } from "./scene/world";
import type { State } from "./state";
import { actionsOf } from "./actions";
import { Studio } from "./studio";
import { openDialog } from "./ui/dialogs";
import { replaceKeepingFocus } from "./ui/dom";
import { Inspector } from "./ui/inspector";
import { type Action, Keys } from "./ui/keys";
import { legend } from "./ui/legend";
import { Overlay } from "./ui/overlay";
import { Panel } from "./ui/panel";
import { LinkedPlot } from "./ui/plot";
import { nearestFrame, TimeLine } from "./ui/timeline";
import { Views } from "./views";

/** Settings that need no new picture. */
const QUIET = new Set(["speed", "loop", "live", "plot", "look", "frame", "theme", "field", "ortho", "size"]);
/** Pixels; narrower pages begin without the panel of settings. */
const NARROW = 720;
const SYSTEM_DARK = window.matchMedia("(prefers-color-scheme: dark)");

export class App {
  readonly frames: Frames;
  readonly world: World;
  readonly picture: Picture;
  readonly player: Player;
  readonly choosing: Choosing;
  readonly timeline: TimeLine;
  readonly plot: LinkedPlot;
  readonly overlay: Overlay;
  readonly inspector: Inspector;
  readonly panel: Panel;
  readonly actions: Action[];
  readonly keys: Keys;
  readonly views: Views;
  readonly studio: Studio;
  /** Brings the address up to now. */
  beforeCopying: () => void = () => undefined;
  private showing: Promise<void> = Promise.resolve();
  private wanted = 0;

  constructor(
    readonly source: Source,
    readonly state: State,
    readonly stage: Stage,
    readonly known: Known,
    public series: Series,
    readonly page: Layout,
    ownPage: boolean,
  ) {
    this.frames = new Frames(source);
    this.world = new World(stage);
    this.picture = new Picture(this.world, state, this.frames, known);
    this.overlay = new Overlay(stage, known.manifest.unit);
    this.inspector = new Inspector(() => this.choosing.clear());
    this.player = new Player(state, () => this.manifest.times.length, (k) => this.go(k));
    const { picture, world, inspector, overlay } = this;
    const isPlaying = (): boolean => this.player.playing;
    this.choosing = new Choosing(state, picture, world, inspector, overlay, known, source, isPlaying);
    this.plot = new LinkedPlot((time) => void this.go(nearestFrame(this.manifest.times, time)));
    this.timeline = new TimeLine({
      play: () => this.player.toggle(),
      step: (by) => void this.go(state.number("frame") + by),
      go: (k) => void this.go(k),
      event: (direction) => this.toEvent(direction),
    });
    this.views = new Views(stage, this.picture, this.choosing);
    this.studio = new Studio(this);
    this.panel = new Panel(state);
    this.actions = actionsOf(this).filter((a) => ownPage || a.id !== "link"); // a notebook has its own address
    this.keys = new Keys(state, this.actions);
    this.place(ownPage);
    this.wire(ownPage);
  }

  get manifest(): Manifest {
    return this.known.manifest;
  }

  get dark(): boolean {
    const theme = this.state.get<string>("theme");
    return theme === "dark" || (theme === "auto" && SYSTEM_DARK.matches);
  }

  private place(ownPage: boolean): void {
    const { page } = this;
    page.title.textContent = this.manifest.name;
    page.view.append(this.overlay.element, this.inspector.element);
    page.side.append(this.panel.element);
    page.bottom.append(this.timeline.element, this.plot.element);
    page.header.append(headerButtons({
      centre: () => this.views.centre(), picture: () => this.studio.ask("png"),
      link: ownPage ? () => void copyAddress(this) : null,
      help: () => this.help(), panel: () => this.togglePanel(),
    }));
    this.timeline.setFrames(this.manifest.times, this.series.events);
    tellRun(this);
    if (page.root.clientWidth < NARROW) this.togglePanel();
  }

  private wire(ownPage: boolean): void {
    const { stage, page, state } = this;
    new ResizeObserver(() => stage.resize(page.view.clientWidth, page.view.clientHeight)).observe(page.view);
    stage.resize(page.view.clientWidth, page.view.clientHeight);
    const drawWorld = stage.onDraw;
    stage.onDraw = () => {
      drawWorld();
      this.overlay.draw();
    };
    const lost = "The browser has taken the graphics card away from this page; if the picture stays away, reload it.";
    stage.onLost = (away) => {
      if (away) return this.tell(lost);
      if (page.note.textContent === lost) this.tell("");
      this.setTheme(); // a new context does not know the background
    };
    stage.onLook = () => {
      stage.reach = this.picture.reachFrom(stage.look.target); // the haze must not depend on where the eye was before
      state.set("look", lookText(stage));
    };
    let down: [number, number] | null = null;
    page.canvas.addEventListener("pointerdown", (e) => (down = [e.clientX, e.clientY]));
    page.canvas.addEventListener("pointerup", (e) => {
      const still = down && Math.hypot(e.clientX - down[0], e.clientY - down[1]) < 4;
      const box = page.canvas.getBoundingClientRect();
      if (still) this.choosing.clickAt(e.clientX - box.left, e.clientY - box.top);
    });
    this.keys.listen(ownPage ? document : page.root);
    page.root.dataset.lmSuppressShortcuts = "true"; // JupyterLab keeps off while the page has the focus
    this.player.onPlaying = (on) => {
      this.timeline.setPlaying(on);
      this.timeline.told.setAttribute("aria-live", on ? "off" : "polite");
      if (!on) this.redress();
    };
    SYSTEM_DARK.addEventListener("change", () => this.setTheme());
    state.onChange((id) => this.changed(id));
  }

  /** The first picture; settings are as the address has them. */
  async begin(look: string): Promise<void> {
    const first = Math.min(this.state.number("frame"), this.manifest.times.length - 1);
    this.picture.setFrame(await this.frames.nearest(first, this.manifest.times.length));
    this.picture.dress(false);
    this.applyLook();
    this.setTheme();
    await this.go(first);
    this.lookFirst(look);
  }

  /** Where the camera begins: as a text says, or all in sight. */
  private lookFirst(text: string): void {
    if (!lookAs(this.stage, text)) this.views.reset();
    this.choosing.anchor();
    this.stage.draw();
  }

  /** What somebody has written into the address. */
  async takeAddress(text: string): Promise<void> {
    this.player.stop();
    this.state.fromAddress(text);
    const look = this.state.get<string>("look"); // what follows may move the camera
    await this.go(this.state.number("frame"));
    this.lookFirst(look);
  }

  private changed(id: string): void {
    if (id === "frame") void this.show();
    if (id === "theme") this.setTheme();
    if (["ortho", "size", "shade", "field"].includes(id)) this.applyLook();
    if (id === "plot") this.showPlot();
    if (id === "follow") this.choosing.follow();
    if (id === "grain" && this.state.get<boolean>("follow")) this.choosing.turnTo();
    const aims = (id === "follow" || id === "isolate") && this.state.get<boolean>(id);
    if (aims && this.state.number("grain") < 0) this.tellBriefly("Choose a grain first: click it, or press y.");
    if (QUIET.has(id)) return;
    const before = this.picture.shown;
    this.redress();
    if (id === "isolate" || id === "grain") this.views.turnToAlone(before);
  }

  private applyLook(): void {
    const { state, stage, world } = this;
    stage.setOrthographic(state.get("ortho"));
    world.uniforms.uSize.value = state.number("size");
    world.haze = 1.1 * state.number("shade");
    this.overlay.axes = state.get("field");
    stage.redraw();
  }

  private setTheme(): void {
    this.page.root.dataset.theme = this.dark ? "dark" : "light";
    this.world.setTheme(this.dark ? DARK : LIGHT);
    this.timeline.drawTicks();
    this.showPlot();
  }

  showPlot(): void {
    const plot = this.series.plots.find((p) => p.id === this.state.get("plot")) ?? this.series.plots[0];
    if (plot) this.plot.show(this.series, plot, this.dark);
  }

  /** Go to a frame; what is beyond the last is the last. */
  go(frame: number): Promise<void> {
    const last = this.manifest.times.length - 1;
    const k = Math.min(Math.max(Math.round(Math.min(frame, last)), 0), last);
    if (k === this.state.number("frame")) void this.show();
    else this.state.set("frame", k);
    return this.showing;
  }

  private show(): Promise<void> {
    const k = Math.min(this.state.number("frame"), this.manifest.times.length - 1);
    this.wanted = k;
    this.showing = this.frames.get(k).then(
      (frame) => {
        if (this.wanted !== k) return this.showing; // a later wish
        this.picture.setFrame(frame);
        this.redress();
        this.choosing.follow();
        this.stage.draw();
        this.timeline.show(k, frame.step);
        this.plot.moveTo(frame.time);
        this.tell("");
        const ahead = k + 1 < this.manifest.times.length ? k + 1 : 0;
        this.frames.prefetch(ahead, this.manifest.times.length);
        return undefined;
      },
      (error: Error) => {
        if (this.wanted !== k) return this.showing;
        this.player.stop();
        this.timeline.show(k, this.manifest.steps[k]);
        this.plot.moveTo(this.manifest.times[k]);
        this.tell(error.message);
        return undefined;
      },
    );
    return this.showing;
  }

  /** Draw the frame anew with the settings of now. */
  redress(): void {
    const { picture } = this;
    if (!picture.frame) return;
    picture.dress(this.player.playing);
    this.stage.reach = picture.reachFrom(this.stage.look.target);
    this.overlay.field = fieldDirection(this.manifest, picture.frame.frame);
    this.choosing.show();
    replaceKeepingFocus(this.page.legend, legend(picture.key, (grain) => this.choosing.choose(grain)));
    const scaled = picture.quantity.kind === "sequential";
    for (const id of ["palette", "log", "low", "high"]) this.panel.enable(id, scaled);
    const contacts = picture.frame.pair.length / 2;
    const told = `${this.manifest.grains} grains, ${contacts} contacts, coloured by ${picture.quantity.label}`;
    this.page.canvas.setAttribute("aria-label", `${told}; press ? for keys`);
  }

  /** A sentence over the picture; nothing takes it away. */
  tell(sentence: string): void {
    this.page.note.textContent = sentence;
    this.page.note.hidden = !sentence;
  }

  /** A sentence that goes away by itself. */
  tellBriefly(sentence: string): void {
    this.tell(sentence);
    window.setTimeout(() => this.page.note.textContent === sentence && this.tell(""), 2500);
  }

  help(): void {
    const words =
      "Drag to turn, with the right button or two fingers to move, wheel or pinch to go nearer. Click a grain or a " +
      "contact for its numbers. The address of the page holds the view: share it, or keep it.";
    openDialog(this.page.root, "Keys and help", words, this.keys.help());
  }

  togglePanel(): void {
    const away = this.page.root.classList.toggle("gv-panel-away");
    this.page.header.querySelector(".gv-shows-panel")?.setAttribute("aria-expanded", String(!away));
  }

  toEvent(direction: 1 | -1): void {
    const frame = this.timeline.eventFrom(this.state.number("frame"), direction);
    if (frame !== null) void this.go(frame);
  }
}
