// Creates the parts of the page and connects them. Only boot.ts and main.ts use this class.

import { actionsOf } from "./actions";
import { AddressBar } from "./address";
import { CameraController, CLOSE_UP } from "./camera";
import { Frames } from "./data/frames";
import { type Told, toldOf } from "./data/glance";
import { awakeGrains, type Dataset } from "./data/quantities";
import type { Frame, Manifest, Series, Source } from "./data/types";
import { Exporter } from "./exporter";
import { Film } from "./film";
import { headerButtons, type Layout, togglePanel } from "./layout";
import { appendFrames, type LiveRun, offerChoices, runStatus } from "./live";
import { type FrameDisplay, FrameNavigation } from "./navigation";
import { Picture } from "./picture";
import { type Playback, Player } from "./player";
import { lookFromText, lookToText } from "./scene/look";
import type { Stage } from "./scene/stage";
import { DARK, LIGHT, World } from "./scene/world";
import { Selection } from "./selection";
import type { State } from "./state";
import { openDialog } from "./ui/dialogs";
import { onClick, replaceKeepingFocus } from "./ui/dom";
import { Inspector } from "./ui/inspector";
import { type Action, Keys } from "./ui/keys";
import { legend, sharesOf } from "./ui/legend";
import { Note } from "./ui/note";
import { Overlay } from "./ui/overlay";
import { Panel } from "./ui/panel";
import { LinkedPlot } from "./ui/plot";
import { isDark, onSystemThemeChange } from "./ui/theme";
import { nearestFrame, TimeLine } from "./ui/timeline";

/** Settings that do not change the colours, positions or visibility of what is drawn. */
const NO_REFRESH = new Set(["speed", "loop", "live", "plot", "look", "frame", "theme", "field", "ortho", "size"]);
/** Width and height of the page [pixels] below which the panel of settings is hidden at first. */
const [NARROW, LOW] = [720, 480];

const CONTEXT_LOST = "The browser lost the graphics card (WebGL context); if the picture does not return, reload.";

export class App implements FrameDisplay, LiveRun {
  readonly frames: Frames;
  readonly world: World;
  readonly picture: Picture;
  readonly player: Player;
  readonly navigation: FrameNavigation;
  readonly selection: Selection;
  readonly timeline: TimeLine;
  readonly plot: LinkedPlot;
  readonly overlay: Overlay;
  readonly inspector: Inspector;
  readonly panel: Panel;
  readonly actions: Action[];
  readonly keys: Keys;
  readonly camera: CameraController;
  readonly exporter: Exporter;
  readonly film: Film;
  readonly note: Note;
  private readonly address: AddressBar | null;

  constructor(
    readonly source: Source,
    readonly state: State,
    readonly stage: Stage,
    readonly dataset: Dataset,
    private series: Series,
    readonly page: Layout,
    ownsAddress: boolean,
  ) {
    const count = (): number => this.manifest.times.length;
    const go = (frame: number): Promise<void> => this.navigation.go(frame);
    this.note = new Note(page.note);
    this.frames = new Frames(source);
    this.world = new World(stage);
    this.picture = new Picture(this.world, state, this.frames, dataset);
    this.overlay = new Overlay(stage, dataset.manifest.unit);
    this.inspector = new Inspector(() => this.selection.clear());
    this.navigation = new FrameNavigation(state, this.frames, count, this);
    this.player = new Player(state, count, go);
    const playback: Playback = {
      toggle: () => this.player.toggle(),
      go: (frame) => void go(frame),
      step: (by) => void this.navigation.step(by),
      toEvent: (direction) => {
        const frame = this.timeline.eventFrom(state.number("frame"), direction);
        if (frame !== null) void go(frame);
      },
    };
    this.selection = new Selection({
      settings: state, picture: this.picture, scene: this.world, camera: stage, inspector: this.inspector,
      ruler: this.overlay, dataset, source, isPlaying: () => this.player.playing,
    });
    this.plot = new LinkedPlot((time) => void go(nearestFrame(this.manifest.times, time)));
    this.timeline = new TimeLine(playback);
    this.camera = new CameraController(stage, this.picture, this.selection);
    this.exporter = new Exporter({
      root: page.root, world: this.world, manifest: dataset.manifest, settings: state, picture: this.picture,
      playback: { stop: () => this.player.stop(), go }, isDark: () => isDark(state), told: () => this.told(),
      notify: this.notify,
    });
    this.film = new Film(this);
    this.address = ownsAddress
      ? new AddressBar(state, (text) => void this.applyAddress(text), (message) => this.note.showBriefly(message))
      : null;
    this.panel = new Panel(state);
    const commands = {
      help: () => void openDialog(page.root, "Keys and help", ...this.keys.help()),
      togglePanel: () => togglePanel(page),
      copyAddress: this.address && ((): void => void this.address?.copy()),
    };
    const { camera, selection, exporter } = this;
    this.actions = actionsOf({ playback, camera, selection, exports: exporter, page: commands });
    this.keys = new Keys(state, this.actions);
    page.header.append(headerButtons({
      ...commands, showLargest: () => camera.showCluster(selection.largestCluster()), showAll: () => camera.reset(),
      centre: () => camera.centre(), savePicture: () => exporter.openDialog("png") }));
    this.fillPage();
    this.connectStage();
    onClick(page.canvas, (x, y) => this.selection.clickAt(x, y));
    this.keys.listen(ownsAddress ? document : page.root);
    this.player.onPlaying = (on) => {
      this.timeline.setPlaying(on);
      if (!on) this.refresh();
    };
    onSystemThemeChange(() => this.setTheme());
    state.onChange((id) => this.settingChanged(id));
  }

  get manifest(): Manifest {
    return this.dataset.manifest;
  }

  private fillPage(): void {
    const { page, manifest } = this;
    page.root.dataset.lmSuppressShortcuts = "true"; // JupyterLab turns its shortcuts off while the page has the focus
    page.title.textContent = manifest.name;
    page.view.append(this.overlay.element);
    page.side.append(this.inspector.element, this.panel.element);
    page.bottom.append(this.timeline.element, this.plot.element);
    this.timeline.setFrames(manifest.times, this.series.events);
    page.status.textContent = page.status.title = runStatus(manifest);
    if (page.root.clientWidth < NARROW || page.root.clientHeight < LOW) togglePanel(page);
  }

  private connectStage(): void {
    const { stage, state } = this;
    stage.fill(this.page.view);
    const drawWorld = stage.onDraw;
    stage.onDraw = () => {
      drawWorld();
      this.overlay.draw();
    };
    stage.onContextChange = (lost) => {
      if (lost) return this.notify(CONTEXT_LOST);
      if (this.note.message === CONTEXT_LOST) this.notify("");
      this.setTheme(); // a new context has no background colour
    };
    stage.onLook = () => {
      stage.reach = this.picture.reachFrom(stage.look.target); // the haze must not depend on earlier cameras
      state.set("look", lookToText(stage.look));
    };
  }

  /** Show the first picture: the settings are those of the address; without one, see `CameraController.showFirst`. */
  async start(look: string, isFirst: boolean): Promise<void> {
    const first = Math.min(this.state.number("frame"), this.manifest.times.length - 1);
    this.picture.setFrame(await this.frames.nearest(first, this.manifest.times.length));
    this.picture.update(false);
    this.applyViewSettings();
    this.setTheme();
    await this.navigation.go(first);
    this.setInitialLook(look, isFirst);
    this.address?.connect();
  }

  /** Set the camera to the parameters of a text, or, if it is invalid, to the overview or the first view. */
  private setInitialLook(text: string, isFirst = false): void {
    const [look, height] = [lookFromText(text), this.page.canvas.clientHeight];
    if (look) this.stage.look = look;
    else if (this.camera.showFirst(isFirst && this.selection.largestCluster(), height)) this.note.showBriefly(CLOSE_UP);
    this.selection.anchor();
    this.stage.draw();
  }

  /** Apply an address that the user has edited. */
  private async applyAddress(text: string): Promise<void> {
    this.player.stop();
    this.state.fromAddress(text);
    const look = this.state.get<string>("look"); // showing the frame may move the camera
    await this.navigation.go(this.state.number("frame"));
    this.setInitialLook(look);
  }

  private settingChanged(id: string): void {
    const { state, selection } = this;
    if (id === "frame") void this.navigation.show();
    if (id === "theme") this.setTheme();
    if (["ortho", "size", "shade", "field"].includes(id)) this.applyViewSettings();
    if (id === "plot") this.showPlot();
    if (id === "follow") selection.follow();
    if (id === "grain" && state.get<boolean>("follow")) selection.followSelected();
    const needsGrain = (id === "follow" || id === "isolate") && state.get<boolean>(id);
    if (needsGrain && state.number("grain") < 0) this.note.showBriefly("Select a grain first: click it, or press y.");
    if (NO_REFRESH.has(id)) return;
    const before = this.picture.shown;
    this.refresh();
    if (id === "isolate" || id === "grain") this.camera.fitIsolated(before);
  }

  private applyViewSettings(): void {
    const { state, stage, world } = this;
    stage.setOrthographic(state.get("ortho"));
    world.uniforms.uSize.value = state.number("size");
    world.haze = 1.1 * state.number("shade");
    this.overlay.axes = state.get("field");
    stage.redraw();
  }

  private setTheme(): void {
    const dark = isDark(this.state);
    this.page.root.dataset.theme = dark ? "dark" : "light";
    this.world.setTheme(dark ? DARK : LIGHT);
    this.timeline.drawTicks();
    this.showPlot();
    this.showTold();
  }

  /** What is told of the frame as a whole. */
  private told(): Told {
    return toldOf(this.dataset, this.series, this.picture.frame, isDark(this.state));
  }

  private showTold(): void {
    const { glance, directions } = this.told();
    this.overlay.directions = directions;
    this.page.glance.replaceChildren(...sharesOf(glance));
    this.page.glance.hidden = !glance.length;
  }

  private showPlot(): void {
    const plot = this.series.plots.find((p) => p.id === this.state.get("plot")) ?? this.series.plots[0];
    if (plot) this.plot.show(this.series, plot, isDark(this.state));
  }

  showFrame(k: number, frame: Frame): void {
    this.picture.setFrame(frame);
    this.refresh();
    this.selection.follow();
    this.stage.draw();
    this.timeline.show(k, frame.step, awakeGrains(frame));
    this.plot.moveTo(frame.time);
    this.notify("");
  }

  showError(k: number, error: Error): void {
    this.player.stop();
    this.timeline.show(k, this.manifest.steps[k]);
    this.plot.moveTo(this.manifest.times[k]);
    this.notify(error.message);
  }

  /** Update everything that depends on the frame, the settings or the selection. */
  refresh(): void {
    const { picture } = this;
    if (!picture.frame) return;
    picture.update(this.player.playing);
    this.stage.reach = picture.reachFrom(this.stage.look.target);
    this.showTold();
    this.selection.show();
    replaceKeepingFocus(this.page.legend, legend(picture.key, (grain) => this.selection.selectGrain(grain)));
    const scaled = picture.quantity.kind === "sequential";
    for (const id of ["palette", "log", "low", "high"]) this.panel.enable(id, scaled);
    this.page.canvas.setAttribute("aria-label", `${picture.description}; press ? for keys`);
  }

  /** Add new frames of a running simulation; advance to the newest if the last one is shown and "live" is set. */
  append(more: Manifest, series: Series): void {
    const { manifest, page, state, picture, player } = this;
    const atEnd = state.number("frame") >= manifest.times.length - 1;
    appendFrames(manifest, more);
    this.series = series;
    for (const id of offerChoices(state, this.dataset, series)) this.panel.refill(id);
    this.timeline.setFrames(manifest.times, series.events);
    this.showPlot();
    page.status.textContent = page.status.title = runStatus(manifest);
    const advance = atEnd && state.get<boolean>("live") && !player.playing && !this.exporter.busy;
    if (advance) void this.navigation.go(Infinity);
    else if (picture.frame) this.timeline.show(picture.frame.frame, picture.frame.step, awakeGrains(picture.frame));
    if (!advance && !player.playing) this.refresh(); // the ranges of the colour scales may have changed
  }

  readonly notify = (message: string): void => this.note.show(message);

  dispose(): void {
    this.player.stop();
    this.plot.dispose();
    this.stage.dispose();
  }
}
