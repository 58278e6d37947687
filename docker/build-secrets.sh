# shellcheck shell=bash
# To be sourced in the repository's root by what builds images: the files behind the build secrets "ca" and "index"
# (docker/fetching.sh), absolute, because compose takes a relative path from its first file. A named file must exist.
BUILD_CA=$(realpath -e "${BUILD_CA:-${SSL_CERT_FILE:-docker/empty}}") || fail "BUILD_CA names no file"
BUILD_INDEX=$(realpath -e "${BUILD_INDEX:-docker/empty}") || fail "BUILD_INDEX names no file"
