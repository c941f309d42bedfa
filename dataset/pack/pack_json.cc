#include "dataset/pack/pack_json.h"

#include <algorithm>
#include <filesystem>

#include "core/format.h"
#include "core/hash/sha256.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr int kMaxShards = 100000;

Json ToJson(const DoneMarker& m) {
  return {{"file", m.file},
          {"shard", m.number},
          {"num_shards", m.num_shards},
          {"bytes", m.bytes},
          {"sha256", m.sha256},
          {"content_sha256", m.content_sha256},
          {"plan_sha256", m.plan_sha256},
          {"inputs_sha256", m.inputs_sha256},
          {"samples", m.samples},
          {"skipped", m.skipped}};
}

std::string Digest(const JsonView& view) {
  const std::string text = view.Text();
  if (text.size() != 64 || text.find_first_not_of("0123456789abcdef") != std::string::npos) view.Fail("must be a SHA-256");
  return text;
}

int64_t Count(const JsonView& view) {
  if (!view.value().is_number_integer() || view.value() < 0) view.Fail("must be a whole number, 0 or more");
  return view.value().get<int64_t>();
}

DoneMarker FromJson(const JsonView& view) {
  DoneMarker m;
  m.number = static_cast<int>(std::min<int64_t>(Count(view["shard"]), kMaxShards));
  m.num_shards = static_cast<int>(std::min<int64_t>(Count(view["num_shards"]), kMaxShards));
  m.file = view["file"].Text();
  if (m.number >= m.num_shards) view["shard"].Fail("must be below num_shards");
  if (m.file != ShardStem(m.number) + ".h5") view["file"].Fail("must be " + ShardStem(m.number) + ".h5");
  m.bytes = static_cast<uint64_t>(Count(view["bytes"]));
  m.samples = Count(view["samples"]);
  m.sha256 = Digest(view["sha256"]);
  m.content_sha256 = Digest(view["content_sha256"]);
  m.plan_sha256 = Digest(view["plan_sha256"]);
  m.inputs_sha256 = Digest(view["inputs_sha256"]);
  const JsonView skipped = view["skipped"];
  for (size_t i = 0; i < skipped.ArraySize(); ++i) m.skipped.push_back(skipped[i].Text());
  return m;
}

void RequireSchema(const JsonView& view, const char* schema) {
  if (view["schema"].Text() != schema) view["schema"].Fail(std::string("must be ") + schema);
}

}  // namespace

std::string ShardStem(int number) { return Format("shard-%05d", number); }

std::string ShardPath(const std::string& folder, int number) { return folder + "/" + ShardStem(number) + ".h5"; }
std::string DonePath(const std::string& folder, int number) { return folder + "/" + ShardStem(number) + ".done.json"; }

std::string DoneToJsonText(const DoneMarker& marker) {
  Json json = {{"schema", kDoneSchema}};
  json.update(ToJson(marker));
  return json.dump(1) + "\n";
}

std::optional<DoneMarker> ReadDone(const std::string& path) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  const Json json = ParseJsonFile(path);
  const JsonView view(path, json);
  RequireSchema(view, kDoneSchema);
  return FromJson(view);
}

std::string IndexToJsonText(const PackIndex& index) {
  Json json = {{"schema", kIndexSchema}, {"plan_sha256", index.plan_sha256}, {"plan", index.plan}, {"shards", Json::array()}};
  for (const DoneMarker& marker : index.shards) json["shards"].push_back(ToJson(marker));
  return json.dump(1) + "\n";
}

PackIndex ReadIndex(const std::string& path) {
  const Json json = ParseJsonFile(path);
  const JsonView view(path, json);
  RequireSchema(view, kIndexSchema);
  PackIndex index;
  index.plan_sha256 = Digest(view["plan_sha256"]);
  index.plan = view["plan"].value();
  const JsonView shards = view["shards"];
  if (shards.ArraySize() == 0 || shards.ArraySize() > kMaxShards) shards.Fail("holds an impossible number of shards");
  for (size_t i = 0; i < shards.ArraySize(); ++i) {
    index.shards.push_back(FromJson(shards[i]));
    const DoneMarker& m = index.shards.back();
    if (m.number != static_cast<int>(i)) shards[i].Fail("must be shard " + std::to_string(i));
    if (m.num_shards != static_cast<int>(shards.ArraySize())) shards[i].Fail("is of a pack of another number of shards");
    if (m.plan_sha256 != index.plan_sha256) shards[i].Fail("was made with other options than the index says");
  }
  return index;
}

}  // namespace mvstudio::dataset::internal
