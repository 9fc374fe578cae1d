// check.mjs PAGE PROGRAM DIRECTORY: opens out/web.html in headless Chromium, plays each scene and
// compares it with PROGRAM, web.c compiled for this machine. Pictures go to DIRECTORY. No packages:
// Chromium is spoken to through two pipes.
import { spawn, execFile } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';

const [page, program, out] = process.argv.slice(2).map(p => resolve(p));
let failed = 0;
function check(what, good, ...seen) {
    if (!good) ++failed;
    console.log(good ? 'ok' : 'FAILED', what, ...seen);
}

// ---- Chromium -----------------------------------------------------------------------------------
const home = mkdtempSync(join(tmpdir(), 'web-'));
const browser = spawn(process.env.CHROMIUM || 'chromium', ['--headless=new', '--no-sandbox',
    '--remote-debugging-pipe', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
    '--disable-dev-shm-usage', `--user-data-dir=${home}`, 'about:blank'],
    { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'] });
const waits = new Map(), complaints = [];
let count = 0, session, rest = '';
function call(method, params = {}) {
    const message = { id: ++count, method, params, sessionId: session };
    browser.stdio[3].write(JSON.stringify(message) + '\0');
    return new Promise((done, fail) => waits.set(count, { done, fail }));
}
browser.stdio[4].setEncoding('utf8').on('data', text => {
    const parts = (rest + text).split('\0');
    rest = parts.pop();
    for (const { id, method, params, result, error } of parts.map(p => JSON.parse(p))) {
        const wait = waits.get(id);
        if (wait) error ? wait.fail(Error(error.message)) : wait.done(result);
        if (/exceptionThrown|consoleAPICalled|entryAdded/.test(method))
            complaints.push(JSON.stringify(params).slice(0, 300));
    }
});
function give_up(why) {
    console.log('FAILED', why);
    browser.kill();
    process.exit(1);
}
browser.on('error', e => give_up(e.message));
setTimeout(give_up, 300e3, 'nothing for five minutes').unref();
const sleep = ms => new Promise(done => setTimeout(done, ms));
async function value(expression) {
    const r = await call('Runtime.evaluate', { expression, returnByValue: true });
    const thrown = r.exceptionDetails;
    if (thrown) throw Error(expression + ': ' + thrown.exception.description);
    return r.result.value;
}
async function until(expression) {
    for (let i = 0; i < 1200; ++i, await sleep(100)) if (await value(expression)) return;
    throw Error('never came: ' + expression);
}
// Small while it plays, as all is drawn by the processor here
const size = (width, height) => call('Emulation.setDeviceMetricsOverride',
    { width, height, deviceScaleFactor: 1, mobile: false });
async function open(base, settings) {
    await size(820, 300);
    await call('Page.navigate', { url: 'about:blank' });
    await call('Page.navigate', { url: `${base}#${new URLSearchParams(settings)}` });
    await until('document.readyState === "complete" && typeof frame !== "undefined"');
}
async function picture(name) {
    await size(1280, 720);
    await sleep(700);                                   // the status line comes twice a second
    const { data } = await call('Page.captureScreenshot', { format: 'png' });
    writeFileSync(join(out, name), Buffer.from(data, 'base64'));
}
// The view's pixels are kept under a name; how many of a hundred differ between two of them?
const keep = name => value(`draw(), globalThis.${name} = new Uint8Array(4 * gl.canvas.width
    * gl.canvas.height), gl.readPixels(0, 0, gl.canvas.width, gl.canvas.height, gl.RGBA,
    gl.UNSIGNED_BYTE, ${name}), 0`);
const differ = (a, b) => value(`100 / ${a}.length * ${a}.reduce((n, x, i) =>
    n + (Math.abs(x - ${b}[i]) > 8), 0)`);

// ---- scenes -------------------------------------------------------------------------------------
// What the program for this machine says of the same settings: a sentence and a hash
function native(s) {
    const order = ['scene', 'cells', 'scheme', 'integrator', 'flip', 'viscosity', 'dt', 'end'];
    const given = order.map(key => s[key] ?? 0);
    return new Promise(done => execFile(program, given, (e, said) => done(said.split('\n'))));
}
const sum = n => n[3] + n[4] + n[5];
async function play(name, base, s) {
    const here = native(s);
    await open(base, s);
    await until('frame || $("error").textContent');
    await keep('first');
    await until('frame && frame.ended || $("error").textContent');
    await keep('last');
    const [sentence, hash] = await here, end = await value('frame');
    check(`${name}: no refusal`, sentence === '' && await value('$("error").textContent') === '');
    check(`${name}: the state is that of this machine`, end.hash === hash, end.hash, hash);
    const changed = await differ('first', 'last');
    check(`${name}: pixels moved`, changed > 0.5, changed.toFixed(1) + ' %');
    check(`${name}: volume`, Math.abs(end.n[6] / end.n[8] - 1) < 0.03, end.n[6] / end.n[8]);
    await picture(name + '.png');
    return [await value('curves[0].n'), end.n];
}
async function refuse(name, base, s) {
    await open(base, s);
    await until('$("error").textContent');
    const said = await value('$("error").textContent');
    check(`${name}: refused with the library's sentence`, said === (await native(s))[0], said);
    await picture(name + '.png');
}
async function turns(name, event) {
    await keep('still');
    await event();
    await sleep(300);
    await keep('turned');
    const changed = await differ('still', 'turned');
    check(name, changed > 1, changed.toFixed(1) + ' %');
}
const mouse = (type, x, y, more) => call('Input.dispatchMouseEvent', { type, x, y, ...more });

async function all(server) {
    const { targetId } = await call('Target.createTarget', { url: 'about:blank' });
    ({ sessionId: session } = await call('Target.attachToTarget', { targetId, flatten: true }));
    for (const domain of ['Page', 'Runtime', 'Log']) await call(domain + '.enable');
    const disk = 'file://' + page;

    let [, n] = await play('pour', disk, { scene: 0, cells: 16, viscosity: 10, end: 2 });
    const given = n[8] / (Math.PI * 0.004 ** 2 * (0.11 * 2 + 0.006));
    check('pour: what the emitter gave', Math.abs(given - 1) < 0.05, given);
    const share = sum(n) / (1420 * n[8] * (9.81 * 0.071 + 0.11 ** 2 / 2));
    check('pour: energy is less than was given, and is not gone', share > 0.05 && share < 1, share);
    await turns('a drag turns the view', async () => {
        await mouse('mousePressed', 600, 400, { button: 'left', buttons: 1 });
        await mouse('mouseMoved', 700, 420, { button: 'left', buttons: 1 });
        await mouse('mouseReleased', 700, 420, { button: 'left' });
    });
    await turns('the wheel zooms', () => mouse('mouseWheel', 600, 400, { deltaX: 0, deltaY: 400 }));

    const base = `http://127.0.0.1:${server.address().port}/`;
    const drop = { scene: 1, cells: 24, scheme: 2, viscosity: 4, end: 0.1 };
    let [a, b] = await play('drop', base, drop);
    check('drop: energy falls', sum(b) < sum(a) && sum(b) > 0, sum(a), sum(b));
    [a, b] = await play('bounce', base, { scene: 2, cells: 20, viscosity: 0, end: 0.13 });
    check('bounce: energy', sum(b) / sum(a) > 0.8 && sum(b) / sum(a) < 1.002, sum(b) / sum(a));
    await refuse('combination', base, { ...drop, scheme: 0, integrator: 1 });
    await value('set("integrator", 0), set("scheme", 2), start(), 0');
    await until('frame && frame.time > 0');
    check('combination: the next one runs', await value('$("error").textContent') === '');
    await refuse('long_step', disk, { ...drop, scheme: 0, dt: 0.01 });
    await value('set("dt", 0), change(), 0');
    await until('frame.time > 0');
    check('long_step: it goes on in shorter ones', await value('$("error").textContent') === '');
}
const server = createServer((request, response) => {
    response.writeHead(200, { 'content-type': 'text/html' });
    response.end(request.url === '/' ? readFileSync(page) : '');
}).listen(0, '127.0.0.1', async () => {
    await all(server).catch(e => check(e.message, false));
    check('nothing on the console', complaints.length === 0, ...complaints);
    browser.kill();
    browser.on('exit', () => {
        rmSync(home, { recursive: true, force: true, maxRetries: 5 });
        process.exit(failed ? 1 : 0);
    });
});
