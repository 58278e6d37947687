# shellcheck shell=sh
# To be sourced in a build step that downloads packages. Two optional build secrets: "ca", certificates of a
# proxy that inspects TLS, and "index", the address of the package index where it is not the public one (it may hold
# a password, so it is no build argument).
export PIP_DISABLE_PIP_VERSION_CHECK=1 UV_NATIVE_TLS=1 UV_LINK_MODE=copy UV_NO_CACHE=1
if [ -s /run/secrets/ca ]; then
  export SSL_CERT_FILE=/run/secrets/ca PIP_CERT=/run/secrets/ca GIT_SSL_CAINFO=/run/secrets/ca
else
  # Without the package ca-certificates, uv's own roots are all there is.
  [ -s /etc/ssl/certs/ca-certificates.crt ] || export UV_NATIVE_TLS=0
fi
if [ -s /run/secrets/index ]; then
  PIP_INDEX_URL=$(cat /run/secrets/index)
  export PIP_INDEX_URL UV_DEFAULT_INDEX="$PIP_INDEX_URL"
fi
