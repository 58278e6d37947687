# shellcheck shell=bash
# To be sourced in the repository's root: hands pip's package index and the machine's certificates to uv, which reads
# neither by default. tools: where pip is, unless it is .cache/tools.
index=$("${tools:-.cache/tools}/bin/pip" config get global.index-url 2> /dev/null) || index=${PIP_INDEX_URL:-}
[ -z "$index" ] || export UV_DEFAULT_INDEX=${UV_DEFAULT_INDEX:-$index}
export UV_NATIVE_TLS=1
