#include "stages/part.h"

#include <cstdio>

#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::stages {
namespace {

constexpr char kPartSchema[] = "mvstudio.part/1";
constexpr char kSamplesWord[] = "samples=", kFramesWord[] = "frames=", kShareWord[] = "share=";

bool Begins(const std::string& text, const std::string& word) { return text.rfind(word, 0) == 0 && text.size() > word.size(); }

/// "cam_01:3-5"; a colon that no numbers follow belongs to the name.
void ReadBlocks(StagePart* part) {
  const size_t colon = part->camera.rfind(':');
  if (colon == std::string::npos || colon == 0) return;
  const std::string blocks = part->camera.substr(colon + 1);
  long long first = 0, last = 0;
  int used = 0;
  if (std::sscanf(blocks.c_str(), "%lld-%lld%n", &first, &last, &used) != 2 || used != static_cast<int>(blocks.size())) return;
  if (first < 0 || last < first || last > std::numeric_limits<int32_t>::max())
    throw UsageError("option 'part': blocks " + blocks + " are no range of numbers from 0, e.g. 3-5");
  part->first_block = first, part->end_block = last + 1;
  part->camera.resize(colon);
}

void ReadShare(const std::string& text, StagePart* part) {
  int used = 0;
  const bool whole =
      std::sscanf(text.c_str(), "%d/%d%n", &part->index, &part->count, &used) == 2 && used == static_cast<int>(text.size());
  if (!whole || part->index < 0 || part->index >= part->count)
    throw UsageError("option 'part': share=" + text + ": use share=K/N with 0 <= K < N");
}

}  // namespace

StagePart ParsePart(const std::string& text) {
  StagePart part;
  if (text == "choice") return part;
  if (Begins(text, kSamplesWord)) {
    part.kind = PartKind::kSamples, part.camera = text.substr(sizeof(kSamplesWord) - 1);
    return part;
  }
  if (Begins(text, kShareWord)) {
    part.kind = PartKind::kShare;
    ReadShare(text.substr(sizeof(kShareWord) - 1), &part);
    return part;
  }
  if (!Begins(text, kFramesWord))
    throw UsageError("option 'part' " + text +
                     ": expected choice, samples=CAMERA, frames=CAMERA, frames=CAMERA:3-5 or share=K/N");
  part.kind = PartKind::kFrames, part.camera = text.substr(sizeof(kFramesWord) - 1);
  ReadBlocks(&part);
  return part;
}

std::string ToString(const StagePart& part) {
  if (part.kind == PartKind::kChoice) return "choice";
  if (part.kind == PartKind::kSamples) return kSamplesWord + part.camera;
  if (part.kind == PartKind::kShare) return kShareWord + std::to_string(part.index) + "/" + std::to_string(part.count);
  const bool all = part.end_block == std::numeric_limits<int64_t>::max();
  const std::string blocks = std::to_string(part.first_block) + "-" + std::to_string(part.end_block - 1);
  return kFramesWord + part.camera + (all ? "" : ":" + blocks);
}

void WritePart(const PartReport& report, const std::string& folder) {
  const nlohmann::ordered_json json = {{"schema", kPartSchema}, {"part", report.part}, {"kept", report.kept}};
  WriteFileAtomic(folder + "/part.json", json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
}

CommandResult Describe(const PartReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  result.metrics = {{"part", report.part}, {"kept", report.kept.size()}};
  result.outputs.push_back({report.out + "/part.json", "part"});
  result.folder = report.out;
  result.text = report.part + ": " + std::to_string(report.kept.size()) + " results are kept\n";
  return result;
}

}  // namespace mvstudio::stages
