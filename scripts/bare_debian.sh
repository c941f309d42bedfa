# Sourced by scripts/try-*: makes a bare Debian in a folder of its own, $root, which goes when the script ends. Needs root and debootstrap;
# ends with 77 where one of them is missing. MVSTUDIO_TRIAL: an existing bare Debian, which is copied, in place of a new one.
# MVSTUDIO_TRIAL_SKIP: words, each of a part of the script that is left out.
trial=$(basename "$0")
[ "$(id -u)" = 0 ] || { echo "$trial: needs root, to change the root folder" >&2; exit 77; }
command -v debootstrap >/dev/null || { echo "$trial: debootstrap is not installed" >&2; exit 77; }

root=$(mktemp -d /var/tmp/mvstudio-trial-XXXXXX)
end() {
  for folder in proc dev; do mountpoint -q "$root/$folder" && umount -l "$root/$folder"; done
  rm -rf --one-file-system "$root"
}
trap end EXIT

step() {  # step NAME COMMAND…: runs it, prints its seconds, and its last lines where it fails
  local name=$1 begin=$EPOCHREALTIME
  shift
  "$@" >"$root.log" 2>&1 || { tail -25 "$root.log" >&2; echo "$trial: '$name' failed" >&2; rm -f "$root.log"; exit 1; }
  awk -v a="$begin" -v b="$EPOCHREALTIME" -v n="$name" 'BEGIN {printf "%7.1f s  %s\n", b - a, n}'
  rm -f "$root.log"
}
inside() { chroot "$root" env -i HOME=/root LANG=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive "$@"; }

if [ -n "${MVSTUDIO_TRIAL:-}" ]; then
  step "a copy of $MVSTUDIO_TRIAL" cp -a "$MVSTUDIO_TRIAL/." "$root"
else
  step "a bare Debian 12" debootstrap --variant=minbase bookworm "$root" "${MVSTUDIO_MIRROR:-http://deb.debian.org/debian}"
fi
for way in /etc/apt/apt.conf.d /usr/local/share/ca-certificates; do  # how this machine reaches the archive
  [ -d "$way" ] && mkdir -p "$root$way" && cp -an "$way/." "$root$way"
done
cp /etc/resolv.conf "$root/etc/" 2>/dev/null || true
mount -t proc proc "$root/proc"
mount --rbind /dev "$root/dev"
mount --make-rslave "$root/dev"  # else what is unmounted here at the end goes from this machine's own /dev, too
skips() { [[ " ${MVSTUDIO_TRIAL_SKIP:-} " == *" $1 "* ]]; }
step "apt update" inside apt-get update
