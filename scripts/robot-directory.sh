# shellcheck shell=bash
# To be sourced by scripts/upgrade-robot, with $robot: the directory with a robot's compose.yaml and .env. Which version is
# in it, and how another one takes its place. The robot's own files stay: .env, docker/config, docker/vendor, and whatever
# lies beside the files of a release.
state=${robot:?}/.upgrade

current_tag() {
  local named
  named=$(sed -n 's/^TAG=//p' "$robot/.env" 2> /dev/null | tail -n 1)
  echo "${named:-latest}"
}

# In .env, as one change: a power cut leaves the old file or the new one. The file keeps its owner, and a link stays a
# link.
set_tag() {
  local env new
  env=$(realpath --canonicalize-missing "$robot/.env")
  new=$(dirname "$env")/.env.new
  (umask 077; { grep -v '^TAG=' "$env" 2> /dev/null || true; echo "TAG=$1"; } > "$new")
  if [ -e "$env" ]; then
    # One who may not give files away keeps this one.
    chown --reference="$env" "$new" 2> /dev/null || true
    chmod --reference="$env" "$new"
  fi
  sync "$new"
  mv "$new" "$env"
}

# Puts the robot's own files into a tree that has not run here yet.
keep_own_files() {
  local tree=$1 folder
  for folder in docker/config docker/vendor; do
    [ -d "$robot/$folder" ] || continue
    mkdir -p "$tree/$folder"
    # What the release has beside them is newer: texts about the folder, files that this robot lacks.
    find "$robot/$folder" -mindepth 1 -maxdepth 1 ! -name '*.md' -exec cp -a -t "$tree/$folder" {} +
  done
}

# Lays a tree over the robot's directory in $state/trial, as it would be after the switch, without touching anything.
trial_directory() {
  local tree=$1 tag=$2
  rm -rf "$state/trial"
  mkdir "$state/trial"
  find "$robot" -mindepth 1 -maxdepth 1 ! -name .upgrade ! -name .env -exec ln -s -t "$state/trial" {} +
  find "$tree" -mindepth 1 -maxdepth 1 -exec ln -sfn -t "$state/trial" {} +
  { grep -v '^TAG=' "$robot/.env" 2> /dev/null || true; echo "TAG=$tag"; } > "$state/trial/.env"
}

# The tree of a tag while it is not in use.
tree_of() { echo "$state/trees/$1"; }

# Moves the tree of one tag into the robot's directory, and what was there in its place to the tree of the other. Called
# again after an interruption, in either direction, it does the rest.
switch_trees() {
  local into out path name
  into=$(tree_of "$1") out=$(tree_of "$2")
  mkdir -p "$into" "$out"
  for path in "$into"/* "$into"/.[!.]*; do
    name=${path##*/}
    [ -e "$path" ] || continue
    # -T: into its place, never into a directory that is there.
    [ ! -e "$robot/$name" ] || mv -T "$robot/$name" "$out/$name"
    mv -T "$path" "$robot/$name"
  done
  rmdir "$into"
}
