#!/usr/bin/env bash
# Installs the Debian package in a fresh Debian 12 and follows the tutorial there, as root, with
# debootstrap and a network; not part of ctest (minutes, 2 GB):
#   tests/install/package.sh DEB WORK [EUROC]
# EUROC: EuRoC's MH_01_easy, for the tutorial's blocks that need it.
set -euo pipefail
deb=$(realpath "$1") work=$(realpath -m "$2") euroc=${3:+$(realpath "$3")}
here=$(realpath "$(dirname "${BASH_SOURCE[0]}")")
system=$work/debian12
mkdir -p "$work"
[[ -e $system/etc/debian_version ]] || debootstrap --variant=minbase bookworm "$system" >"$work/debootstrap.log"
cp "$deb" "$system/root/vio-slam.deb"
cp "$here/tutorial.sh" "$system/root/"
rm -rf "$system/root/euroc"
[[ -z $euroc ]] || cp -r "$euroc" "$system/root/euroc"

in_debian() { chroot "$system" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root "$@"; }
in_debian apt-get update --quiet=2
in_debian env DEBIAN_FRONTEND=noninteractive apt-get install --yes --quiet=2 /root/vio-slam.deb >"$work/apt.log"
in_debian sh -c 'ldd /usr/bin/vio-slam | grep "not found"' && { echo "libraries are missing" >&2; exit 1; }
in_debian vio-slam --version
in_debian bash /root/tutorial.sh /usr /usr/share/vio-slam/TUTORIAL.md /root/tutorial \
    ${euroc:+/root/euroc} >"$work/tutorial.log" 2>&1 || { tail -n 20 "$work/tutorial.log" >&2; exit 1; }
tail -n 1 "$work/tutorial.log"
in_debian apt-get purge --yes --quiet=2 vio-slam >>"$work/apt.log"
left=$(in_debian sh -c 'find / -xdev -not -path "/root/*" -not -path "/proc/*" -name "*vio*slam*"')
[[ -z $left ]] || { echo "purged, but still there: $left" >&2; exit 1; }
echo "the package installs, works and goes"
