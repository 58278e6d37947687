#!/usr/bin/env bash
# Makes debian:bookworm-slim, or another suite's image, from the distribution's own packages where no image registry can
# be reached. Every Dockerfile that says FROM debian:SUITE-slim then builds. Does nothing when the image is there.
#   docker/base-image.sh [--force] [--arch arm64] [SUITE]
# --force makes it anew. SUITE: bookworm (default), trixie. --arch makes that of another processor, as SUITE-slim-arm64, because
# a tag has one platform; programs of it must run here (docker/emulation).
# Uses the package mirrors this machine uses, or the one named in DEBIAN_MIRROR.
set -euo pipefail
cd "$(dirname "$0")/.."
force=no
suite=bookworm
own=$(dpkg --print-architecture)
arch=$own
usage() { echo "usage: docker/base-image.sh [--force] [--arch amd64 | arm64] [bookworm | trixie]" >&2; exit 2; }
while [ $# -gt 0 ]; do
  case "$1" in
    --force) force=yes ;;
    --arch)
      shift
      case "${1:-}" in amd64 | arm64) arch=$1 ;; *) usage ;; esac
      ;;
    bookworm | trixie) suite=$1 ;;
    *) usage ;;
  esac
  shift
done
image=debian:$suite-slim
[ "$arch" = "$own" ] || image=$image-$arch

fail() { echo "base-image: $1" >&2; exit 1; }
say() { echo "base-image: $1" >&2; }

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

# One line per package source of the suite this machine knows: address, release, section.
sources() {
  if [ -n "${DEBIAN_MIRROR:-}" ]; then
    echo "$DEBIAN_MIRROR $suite main"
  else
    # shellcheck disable=SC2016  # apt expands these, not the shell
    apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(COMPONENT)' 'Created-By: Packages' |
      awk -v suite="$suite" '$2 ~ "^" suite "(-updates|-security)?$" && $3 == "main"' | sort -u
  fi
}

[ $force = yes ] || ! docker image inspect "$image" > /dev/null 2>&1 || exit 0
[ "$arch" != arm64 ] || docker/emulation --check
command -v debootstrap > /dev/null || fail "debootstrap is missing. Type: sudo apt install debootstrap"
mirror=$(sources | awk -v suite="$suite" '$2 == suite { print $1; exit }')
[ -n "$mirror" ] || fail "this machine has no package source for Debian $suite. Name one: DEBIAN_MIRROR=http://... $0"

mkdir -p .cache
root=$(mktemp -d .cache/base-image.XXXXXX)
trap 'as_root rm -rf "$root"' EXIT
started=$SECONDS
say "making $image from packages"
as_root debootstrap --variant=minbase --arch "$arch" "$suite" "$root/system" "$mirror" > ".cache/base-image-$suite-$arch.log" 2>&1 ||
  { tail -n 10 ".cache/base-image-$suite-$arch.log" >&2; fail "debootstrap failed; the lines above say why"; }
sources | sed 's/^/deb /' | as_root tee "$root/system/etc/apt/sources.list" > /dev/null
# The official slim image leaves these out as well: a container needs no manual pages.
as_root rm -rf "$root/system"/usr/share/{doc,man,info,locale}/*
# Of this computer; containers get theirs.
as_root rm -f "$root/system"/etc/{hostname,resolv.conf}
as_root docker/packages clean "$root/system"
printf 'path-exclude /usr/share/%s/*\n' doc man info locale |
  as_root tee "$root/system/etc/dpkg/dpkg.cfg.d/slim" > /dev/null
# Built, not imported: Docker 20.10 takes every import for one of this machine's processor.
mkdir "$root/context"
as_root tar -C "$root/system" -c . > "$root/context/system.tar"
printf '%s\n' 'FROM scratch' 'ADD system.tar /' 'CMD ["bash"]' > "$root/context/Dockerfile"
DOCKER_BUILDKIT=1 docker build --quiet --platform "linux/$arch" -t "$image" "$root/context" > /dev/null
say "$image is there, $((SECONDS - started)) s"
