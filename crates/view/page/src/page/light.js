// The panel for sky and lamps. Its controls send the same lines that scripts and terminals use.

/** Skies that need nothing but the sun, by their names in lines. */
const SKIES = [['clear', 'Clear'], ['intermediate', 'Intermediate'], ['overcast', 'Overcast'], ['uniform', 'Uniform']];

/** What the controls show: the stated options and the lamps' names. */
let shownSky = '', shownLamps = '';

/** Shows the scene's light, unless the person is about to change it. */
function showLight() {
  const light = state.light;
  $('light-panel').hidden = !light || !(light.sky || light.lamps.length);
  if ($('light-panel').hidden) return;
  $('f-sky').hidden = !light.sky;
  // The sliders show the factors of lamps.
  const words = light.words.filter(text => !text.endsWith('(--lamp)'));
  $('light-words').textContent = words.map(text => text[0].toUpperCase() + text.slice(1)).join('. ');
  const sky = JSON.stringify(light.options);
  if (sky !== shownSky) {
    shownSky = sky;
    fillSky(light.options);
  }
  const names = JSON.stringify(light.lamps.map(([name]) => name));
  if (names !== shownLamps) {
    shownLamps = names;
    $('lamps').replaceChildren(...light.lamps.map(([name], index) => lampRow(name, index)));
  }
  light.lamps.forEach(([, factor], index) => {
    const range = $(`lamp-${index}`);
    if (range.dataset.stated === String(factor)) return;
    range.dataset.stated = factor;
    range.max = Math.max(200, 100 * factor);
    range.value = 100 * factor;
    range.oninput();
  });
}

/** Fills the controls of the sky with its options. */
function fillSky({ sky, place, at, weather, direct, diffuse, north }) {
  const known = [...SKIES], add = (value, name) => { if (!known.some(([other]) => other === value)) known.push([value, name]); };
  if (weather || (direct && diffuse)) add('perez', weather ? 'Perez, from the weather file' : 'Perez, as measured');
  const implied = sky || (at ? weather || diffuse ? 'perez' : 'clear' : '');
  if (!implied) known.unshift(['', 'As it is']);
  else add(implied, implied);
  $('l-sky').replaceChildren(...known.map(([value, name]) => new Option(name, value)));
  $('l-sky').value = implied;
  $('t-place').value = place || '';
  $('t-place').placeholder = weather ? 'of the weather file' : '52.37,4.90';
  const [, date, hour, minute, zone] = /^(\d+-\d+-\d+)[T ](\d+):(\d+)(?::\d+)?(.*)$/.exec(at || '') || [];
  $('t-date').value = date || '';
  $('t-zone').value = zone || '';
  $('r-hour').value = date ? 60 * Number(hour) + Number(minute) : 720;
  $('r-north').value = north || 0;
  skyWords();
}

/** Returns minutes since midnight as an hour on the clock. */
function clock(minutes) { return [minutes / 60, minutes % 60].map(part => String(Math.floor(part)).padStart(2, '0')).join(':'); }

function skyWords() {
  $('o-hour').textContent = clock(Number($('r-hour').value));
  $('r-hour').setAttribute('aria-valuetext', $('o-hour').textContent);
  $('o-north').textContent = `${$('r-north').value}°`;
}

/** Returns the zone of a place by its longitude, as the sun has it. */
function zoneOf(place) {
  const hours = Math.round(Number(place.split(',')[1]) / 15) || 0;
  return `${hours < 0 ? '-' : '+'}${String(Math.abs(hours)).padStart(2, '0')}:00`;
}

/** Sends the sky that the controls show, once they state one. */
function sendSky() {
  const place = $('t-place').value.replace(/\s/g, ''), weather = state.light.options.weather;
  let sky = $('l-sky').value;
  const hasPlace = Boolean(place || weather);
  if (hasPlace && !$('t-date').value) {
    // The day of the person, which is then in the field for all to see.
    const now = new Date();
    $('t-date').value = [now.getFullYear(), now.getMonth() + 1, now.getDate()].map(part => String(part).padStart(2, '0')).join('-');
  }
  if (place && !$('t-zone').value && !weather) $('t-zone').value = zoneOf(place);
  if (!sky && hasPlace) sky = $('l-sky').value = 'clear';
  const needsSun = !['', 'overcast', 'uniform'].includes(sky);
  $('t-place').setAttribute('aria-invalid', needsSun && !hasPlace);
  if (!sky || (needsSun && !hasPlace)) return notice('The sun needs a place: degrees north and east, such as 52.37,4.90.', 5000);
  const words = [`sky ${sky}`];
  const { options } = state.light;
  if (place) words.push(`place ${place}`); else if (options.place) words.push('place none');
  if (!hasPlace && options.at) words.push('at none');
  if (hasPlace) words.push(`at ${$('t-date').value}T${clock(Number($('r-hour').value))}${$('t-zone').value.trim()}`);
  if (needsSun || Number($('r-north').value) || options.north) words.push(`north ${$('r-north').value}`);
  command(words.join(' '));
}

/** Makes the row of a group of lamps. */
function lampRow(name, index) {
  const label = document.createElement('label'), percent = document.createElement('output'), range = document.createElement('input');
  Object.assign(range, { type: 'range', id: `lamp-${index}`, min: 0, max: 200, step: 5 });
  range.setAttribute('aria-label', `Light of ${name} in percent`);
  range.oninput = () => { percent.textContent = Number(range.value) ? `${Math.round(range.value)} %` : 'off'; };
  range.onchange = () => command(`lamp ${name} ${Number(range.value) / 100}`);
  label.append(name, ' ', percent, range);
  return label;
}

/** Lets the controls act. A slider acts once it is released. */
function wireLight() {
  $('r-hour').oninput = $('r-north').oninput = skyWords;
  for (const id of ['l-sky', 't-place', 't-date', 't-zone', 'r-hour', 'r-north']) $(id).onchange = sendSky;
  $('f-sky').addEventListener('submit', event => { event.preventDefault(); document.activeElement.blur(); });
}
