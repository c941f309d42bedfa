#include "stages/fronts/peers.h"

#include "core/disk/files.h"
#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/process.h"
#include "stages/result.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

double NumberOf(const ordered_json& json, const char* key) {
  return json.contains(key) && json[key].is_number() ? json[key].get<double>() : NAN;
}

std::string TextOf(const ordered_json& json, const char* key) {
  return json.contains(key) && json[key].is_string() ? json[key].get<std::string>() : "";
}

FrontWay PeerWay(const ordered_json& json) {
  FrontWay way;
  way.mark = WayMark::kPeer;
  way.name = TextOf(json, "name"), way.command = TextOf(json, "command"), way.why_not = TextOf(json, "why_not");
  way.seconds = NumberOf(json, "seconds"), way.cpu_s = NumberOf(json, "processor_seconds");
  way.peak_rss_mb = NumberOf(json, "peak_rss_mb"), way.error = NumberOf(json, "error");
  if (way.why_not.empty() && !std::isfinite(way.error)) way.why_not = "it gave no error";
  return way;
}

FrontWay FailedPeers(const std::string& program, const std::string& why) {
  FrontWay way;
  way.name = program, way.mark = WayMark::kPeer, way.why_not = why;
  return way;
}

}  // namespace

std::vector<FrontWay> PeerWays(const std::string& program, const std::string& stage, const FrontsMaterial& material) {
  const std::string folder = material.runs + "/peers-" + stage, out = folder + "/ways.json", said = folder + "/said.txt";
  MakeFolder(folder);
  WriteFileAtomic(out, std::string()), WriteFileAtomic(said, std::string());
  const int exit = RunProcess({program, stage, "session=" + material.session, "take=" + material.take,
                               "calib=" + material.calibration, "out=" + folder, "threads=" + std::to_string(material.threads)},
                              {out, said});
  if (exit != 0) {
    const std::string text = ReadFile(said), line = text.substr(0, text.find('\n'));
    return {FailedPeers(program, "it ended with " + std::to_string(exit) + (line.empty() ? "" : ": " + line))};
  }
  const ordered_json json = ordered_json::parse(ReadFile(out), nullptr, false);
  if (!json.is_array()) return {FailedPeers(program, "it printed no JSON list")};
  std::vector<FrontWay> ways;
  for (const ordered_json& way : json) ways.push_back(PeerWay(way));
  return ways;
}

}  // namespace mvstudio::stages
