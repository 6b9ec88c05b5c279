#!/bin/sh
# The core with AVX-512 on an emulated processor: all calls of digest.c, AVX2 and AVX-512 compared with
# SSE2 bit by bit, and the same digest as here. As root on Debian: it installs the emulator Bochs and a kernel.
# Words: how many inputs of each of ten seeds. Loops that gcc makes vectors of are left scalar: Bochs 2.7
# takes a scatter of 256 bits for no instruction; vectors that the source states are as in the package.
set -eu
cd "$(dirname "$0")/../.."
inputs=${1:-500} folder=build/avx512
command -v bochs >/dev/null && command -v xorriso >/dev/null ||
    { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -qq -y --no-install-recommends \
        bochs bochs-term bochsbios vgabios isolinux syslinux-common xorriso busybox-static cpio bsdutils; }
rm -rf $folder && mkdir -p $folder/root/bin $folder/disc/isolinux $folder/kernel
kernel=$(apt-cache depends linux-image-cloud-amd64 | sed -n 's/.*Depends: //p' | head -n 1)
(cd $folder/kernel && apt-get download -qq -o APT::Sandbox::User=root "$kernel" && dpkg -x ./*.deb .)
cp $folder/kernel/boot/vmlinuz-* $folder/disc/vmlinuz

flags="${FLAGS:?those of the build: make test-avx512} -w -Icsrc -Igenerated"
for each in csrc/abi csrc/paths csrc/core_base csrc/core_v3 csrc/core_v4; do
    gcc $flags -fno-tree-loop-vectorize -c $each.c -o $folder/"$(basename $each)".o
done
gcc $flags -O1 tests/fuzz/digest.c $folder/*.o -static -lm -o $folder/root/digest

cp /bin/busybox $folder/root/bin/
cat >$folder/root/init <<END
#!/bin/busybox sh
/bin/busybox mkdir -p /proc
/bin/busybox mount -t proc proc /proc
/bin/busybox grep -q avx512vl /proc/cpuinfo && echo with AVX-512
for seed in 1 2 3 4 5 6 7 8 9 10; do /digest $inputs \$seed || echo failed: \$?; done
echo end
/bin/busybox sleep 1000
END
chmod +x $folder/root/init
(cd $folder/root && find . | cpio --quiet -o -H newc | gzip -1) >$folder/disc/initrd.gz
cp /usr/lib/ISOLINUX/isolinux.bin /usr/lib/syslinux/modules/bios/ldlinux.c32 $folder/disc/isolinux/
cat >$folder/disc/isolinux/isolinux.cfg <<END
DEFAULT linux
LABEL linux
 KERNEL /vmlinuz
 APPEND initrd=/initrd.gz console=ttyS0,115200 quiet nosmp noapic acpi=off nokaslr tsc=reliable lpj=100000 noxsaves clearcpuid=xsaves,xsavec
END
xorriso -as mkisofs -quiet -o $folder/disc.iso -b isolinux/isolinux.bin -c isolinux/boot.cat \
    -no-emul-boot -boot-load-size 4 -boot-info-table $folder/disc 2>/dev/null
cat >$folder/bochsrc <<END
cpu: model=corei7_skylake_x, count=1, ips=200000000
memory: guest=512, host=512
romimage: file=/usr/share/bochs/BIOS-bochs-latest
vgaromimage: file=/usr/share/vgabios/vgabios.bin
ata0-master: type=cdrom, path=$folder/disc.iso, status=inserted
boot: cdrom
com1: enabled=1, mode=file, dev=$folder/said
display_library: term
sound: driver=dummy
speaker: enabled=0
plugin_ctrl: speaker=0
panic: action=fatal
clock: sync=none
log: $folder/log
END
echo c >$folder/commands
: >$folder/said
TERM=vt100 script -qec "exec bochs -q -f $folder/bochsrc -rc $folder/commands" /dev/null >/dev/null </dev/null &
emulator=$!
while kill -0 $emulator 2>/dev/null && ! grep -q '^end' $folder/said; do sleep 5; done
kill $emulator 2>/dev/null || true # a halted machine does not end by itself
tr -d '\r' <$folder/said | grep -E 'AVX-512|inputs|failed|end' >$folder/there
{ echo "with AVX-512"; for seed in 1 2 3 4 5 6 7 8 9 10; do $folder/root/digest "$inputs" $seed; done; echo end; } >$folder/here
diff $folder/here $folder/there && echo "the same bits with AVX-512: $((10 * inputs)) inputs"
