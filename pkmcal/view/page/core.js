// The package's own C, compiled to WebAssembly, with the machine in its memory (csrc/view).
const ARRAYS = {
  limbs: ['pose', 'q', 'found', 'residual', 'phi', 'byStep', 'byFree', 'byQ', 'onMap', 'poseByFree', 'a', 'b',
    'drive', 'onBase', 'onPlatform', 'sphere'],
  chains: ['pose', 'q', 'found', 'residual', 'phi', 'byStep', 'byFree', 'byQ', 'onMap', 'poseByFree', 'a', 'b',
    'passive', 'frames'],
  arm: ['q', 'tool', 'pose', 'jacobian', 'frames'],
}
const SPHERE = 16 // numbers of a limb: platform joint, anchor, length, three axes

async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0))
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'))
  return new Response(stream).arrayBuffer()
}

// the compiled module is the same for every machine of a page
const compiled = {}

async function loadedCore(data) {
  const text = data.wasm
  compiled[data.kind] ??= unpacked(text).then(bytes => WebAssembly.compile(bytes))
  const [module, machine] = await Promise.all([compiled[data.kind], unpacked(data.machine)])
  const wasm = (await WebAssembly.instantiate(module, {})).exports
  new Uint8Array(wasm.memory.buffer, wasm.machine_room(), machine.byteLength).set(new Uint8Array(machine))
  if (!(wasm.begin(machine.byteLength, data.numbers) > 0)) throw Error('the core does not take this machine')
  const core = {
    wasm,
    bytes: machine.byteLength,
    numbers: new Float64Array(wasm.memory.buffer, wasm.machine_room() + data.geometry),
    // six numbers of A followed by B
    compose(a, b) {
      core.a.set(a), core.b.set(b)
      wasm.compose()
      return Array.from(core.found.subarray(0, 6))
    },
  }
  ARRAYS[data.kind].forEach((name, k) => { core[name] = new Float64Array(wasm.memory.buffer, wasm.at(k)) })
  return core
}
