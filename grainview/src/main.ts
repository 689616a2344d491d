// placeholder until the page is written
import "./style.css";
document.body.append("Grainview");
