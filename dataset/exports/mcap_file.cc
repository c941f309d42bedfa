#include "dataset/exports/mcap_file.h"

#include <algorithm>
#include <limits>

#include "core/check.h"
#include "core/disk/files.h"

namespace mvstudio::exports {
namespace {

constexpr char kMcapMagic[] = "\x89MCAP0\r\n";
constexpr size_t kChunkBytes = size_t{4} << 20;
constexpr int64_t kNsPerS = 1'000'000'000;

enum class Opcode : uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kDataEnd = 15
};

/// Fields of a record, one after the other.
class Fields {
 public:
  template <class T>
  Fields& Add(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    return *this;
  }
  Fields& AddText(std::string_view text) {
    Add(static_cast<uint32_t>(text.size()));
    bytes_ += text;
    return *this;
  }
  Fields& AddLong(std::string_view bytes) {
    Add(static_cast<uint64_t>(bytes.size()));
    bytes_ += bytes;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string Record(Opcode opcode, const Fields& fields) {
  return std::string(1, static_cast<char>(opcode)) + Fields().AddLong(fields.bytes()).bytes();
}

std::string CountsText(const std::map<uint16_t, uint64_t>& counts) {
  Fields map;
  for (const auto& [channel, number] : counts) map.Add(channel).Add(number);
  return map.bytes();
}

}  // namespace

CdrMessage& CdrMessage::AddText(std::string_view text) {
  Add(static_cast<uint32_t>(text.size() + 1));
  body_ += text;
  body_ += '\0';
  return *this;
}

CdrMessage& CdrMessage::AddBytes(std::string_view bytes) {
  Add(static_cast<uint32_t>(bytes.size()));
  body_ += bytes;
  return *this;
}

CdrMessage& CdrMessage::AddHeader(int64_t time_ns, std::string_view frame_id) {
  return Add(static_cast<int32_t>(time_ns / kNsPerS)).Add(static_cast<uint32_t>(time_ns % kNsPerS)).AddText(frame_id);
}

std::string CdrMessage::Bytes() const { return std::string("\0\1\0\0", 4) + body_; }

McapFile::McapFile(std::string path) : path_(std::move(path)) {
  WriteFile(path_, kMcapMagic);
  written_ = sizeof kMcapMagic - 1;
  Put(Record(Opcode::kHeader, Fields().AddText("ros2").AddText("mvstudio")));
}

void McapFile::Put(const std::string& bytes) {
  AppendToFile(path_, bytes);
  written_ += bytes.size();
}

uint16_t McapFile::AddChannel(const std::string& topic, const RosSchema& schema) {
  MVS_CHECK(channels_.size() < std::numeric_limits<uint16_t>::max(), "too many channels");
  const auto [known, is_new] = schema_of_name_.emplace(schema.name, static_cast<uint16_t>(schemas_.size() + 1));
  if (is_new)
    schemas_.push_back(
        Record(Opcode::kSchema, Fields().Add(known->second).AddText(schema.name).AddText("ros2msg").AddText(schema.text)));
  const auto channel = static_cast<uint16_t>(channels_.size() + 1);
  channels_.push_back(
      Record(Opcode::kChannel, Fields().Add(channel).Add(known->second).AddText(topic).AddText("cdr").AddText("")));
  if (is_new) chunk_ += schemas_.back();
  chunk_ += channels_.back();
  return channel;
}

void McapFile::Add(uint16_t channel, int64_t time_ns, const CdrMessage& message) {
  MVS_CHECK(time_ns >= 0 && channel > 0 && channel <= channels_.size(), "channel " << channel << " at " << time_ns << " ns");
  const auto number = static_cast<uint32_t>(counts_[channel]++);
  chunk_index_[channel].emplace_back(time_ns, chunk_.size());
  Fields fields;
  fields.Add(channel).Add(number).Add(time_ns).Add(time_ns);
  chunk_ += std::string(1, static_cast<char>(Opcode::kMessage));
  const std::string bytes = fields.bytes() + message.Bytes();
  chunk_ += Fields().AddLong(bytes).bytes();
  if (chunk_.size() >= kChunkBytes) EndChunk();
}

void McapFile::EndChunk() {
  if (chunk_index_.empty()) return;
  ChunkPlace place{std::numeric_limits<int64_t>::max(), 0, written_, 0, 0, chunk_.size(), {}};
  for (auto& [channel, messages] : chunk_index_) {
    std::stable_sort(messages.begin(), messages.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    place.first_ns = std::min(place.first_ns, messages.front().first);
    place.last_ns = std::max(place.last_ns, messages.back().first);
  }
  Put(Record(Opcode::kChunk, Fields()
                                 .Add(place.first_ns)
                                 .Add(place.last_ns)
                                 .Add(place.size)
                                 .Add(uint32_t{0})  // no checksum
                                 .AddText("")       // no compression
                                 .AddLong(chunk_)));
  place.bytes = written_ - place.at;
  for (const auto& [channel, messages] : chunk_index_) {
    Fields entries;
    for (const auto& [time_ns, at] : messages) entries.Add(time_ns).Add(at);
    place.indexes[channel] = written_;
    Put(Record(Opcode::kMessageIndex, Fields().Add(channel).AddText(entries.bytes())));
  }
  place.index_bytes = written_ - place.at - place.bytes;
  chunks_.push_back(std::move(place));
  chunk_.clear(), chunk_index_.clear();
}

std::string McapFile::Summary() const {
  std::string summary;
  for (const std::string& schema : schemas_) summary += schema;
  for (const std::string& channel : channels_) summary += channel;
  int64_t first_ns = std::numeric_limits<int64_t>::max(), last_ns = 0;
  uint64_t messages = 0;
  for (const auto& [channel, count] : counts_) messages += count;
  for (const ChunkPlace& chunk : chunks_) {
    first_ns = std::min(first_ns, chunk.first_ns), last_ns = std::max(last_ns, chunk.last_ns);
    summary += Record(Opcode::kChunkIndex, Fields()
                                               .Add(chunk.first_ns)
                                               .Add(chunk.last_ns)
                                               .Add(chunk.at)
                                               .Add(chunk.bytes)
                                               .AddText(CountsText(chunk.indexes))
                                               .Add(chunk.index_bytes)
                                               .AddText("")
                                               .Add(chunk.size)
                                               .Add(chunk.size));
  }
  if (chunks_.empty()) first_ns = 0;
  return summary + Record(Opcode::kStatistics, Fields()
                                                   .Add(messages)
                                                   .Add(static_cast<uint16_t>(schemas_.size()))
                                                   .Add(static_cast<uint32_t>(channels_.size()))
                                                   .Add(uint32_t{0})  // attachments
                                                   .Add(uint32_t{0})  // metadata
                                                   .Add(static_cast<uint32_t>(chunks_.size()))
                                                   .Add(first_ns)
                                                   .Add(last_ns)
                                                   .AddText(CountsText(counts_)));
}

void McapFile::Finish() {
  EndChunk();
  Put(Record(Opcode::kDataEnd, Fields().Add(uint32_t{0})));
  const uint64_t summary_at = written_;
  Put(Summary());
  Put(Record(Opcode::kFooter, Fields().Add(summary_at).Add(uint64_t{0}).Add(uint32_t{0})));
  Put(kMcapMagic);
}

}  // namespace mvstudio::exports
