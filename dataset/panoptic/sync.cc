#include "core/disk/files.h"
#include "dataset/json/json_file.h"
#include "dataset/panoptic/panoptic_json.h"

namespace mvstudio::dataset {
namespace {

using internal::Json;
using internal::JsonView;
using Place = std::vector<std::string>;

constexpr size_t kMaxKeyBytes = 200;  // every track keeps the keys above it

bool IsTrack(const JsonView& json) { return json.Has("univ_time") && json["univ_time"].value().is_array(); }

PanopticSyncTrack ReadTrack(const JsonView& json, const Place& place) {
  PanopticSyncTrack track;
  track.place = place;
  track.univ_time_ms = json["univ_time"].Numbers();
  if (json.Has("index")) {
    track.index = json["index"].Numbers();
    if (track.index->size() != track.univ_time_ms.size()) {
      json["index"].Fail("must be as long as univ_time (" + std::to_string(track.univ_time_ms.size()) + "), has " +
                         std::to_string(track.index->size()));
    }
  }
  track.extras = internal::ExtrasOf(json, {"univ_time", "index"});
  return track;
}

/// Objects down to the tracks; the parser has limited the depth.
void Walk(const JsonView& json, Place* place, PanopticSyncTables* tables) {
  for (const auto& [key, value] : json.value().items()) {
    if (key.size() > kMaxKeyBytes) json.Fail("the key " + internal::Quoted(key) + " is too long for a table's name");
    place->push_back(key);
    const JsonView child = json.Entry(key, value);
    if (IsTrack(child)) {
      tables->tracks.push_back(ReadTrack(child, *place));
    } else if (value.is_object() && !value.empty()) {
      Walk(child, place, tables);
    } else {
      tables->extras.emplace_back(*place, value.dump());
    }
    place->pop_back();
  }
}

Json& At(Json& root, const Place& place) {
  Json* at = &root;
  for (const std::string& key : place) at = &(*at)[key];
  return *at;
}

}  // namespace

const PanopticSyncTrack* PanopticSyncTables::Find(const std::string& dotted) const {
  for (const PanopticSyncTrack& track : tracks) {
    std::string name;
    for (const std::string& key : track.place) name += (name.empty() ? "" : ".") + key;
    if (name == dotted) return &track;
  }
  return nullptr;
}

PanopticSyncTables ParsePanopticSyncTables(std::string_view text, const std::string& path) {
  const Json json = internal::ParseJson(text, path);
  const JsonView view(path, json);
  internal::RequireObject(view);
  PanopticSyncTables tables;
  Place place;
  Walk(view, &place, &tables);
  return tables;
}

PanopticSyncTables ReadPanopticSyncTables(const std::string& path) {
  return ParsePanopticSyncTables(internal::ReadTextFile(path, internal::kMaxSyncBytes), path);
}

std::string ToText(const PanopticSyncTables& tables) {
  Json root = Json::object();
  for (const PanopticSyncTrack& track : tables.tracks) {
    Json& at = At(root, track.place);
    at["univ_time"] = track.univ_time_ms;
    if (track.index) at["index"] = *track.index;
    for (const auto& [key, value] : track.extras) at[key] = Json::parse(value);
  }
  for (const auto& [place, value] : tables.extras) At(root, place) = Json::parse(value);
  return root.dump();
}

}  // namespace mvstudio::dataset
