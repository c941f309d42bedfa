// Private: of the exporter mcap.cc alone.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mvstudio::exports {

/// One message in ROS 2's serialization (CDR, little-endian): numbers at multiples of their size, texts and lists behind their
/// length. Source: OMG, "DDS-XTypes", 2020, 7.4.3.
class CdrMessage {
 public:
  template <class T>
  CdrMessage& Add(T value) {
    while (body_.size() % sizeof(T) != 0) body_ += '\0';
    body_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    return *this;
  }
  CdrMessage& AddText(std::string_view text);    ///< with the zero that ends it
  CdrMessage& AddBytes(std::string_view bytes);  ///< uint8[]
  /// std_msgs/Header.
  CdrMessage& AddHeader(int64_t time_ns, std::string_view frame_id);
  std::string Bytes() const;

 private:
  std::string body_;
};

/// Name and definition of a kind of message.
struct RosSchema {
  const char *name, *text;
};

/// A file of messages with times: chunks without compression, their indexes, and a summary, which readers look for first.
/// Source: https://mcap.dev/spec, version 0.
class McapFile {
 public:
  /// Begins a file; `path` is that of a file of core/disk, which publishes it.
  explicit McapFile(std::string path);
  uint16_t AddChannel(const std::string& topic, const RosSchema& schema);
  /// `time_ns` from 0.
  void Add(uint16_t channel, int64_t time_ns, const CdrMessage& message);
  void Finish();

 private:
  struct ChunkPlace {
    int64_t first_ns, last_ns;
    uint64_t at, bytes, index_bytes, size;
    std::map<uint16_t, uint64_t> indexes;  ///< channel -> place of its index
  };
  void Put(const std::string& bytes);
  void EndChunk();
  std::string Summary() const;

  std::string path_;
  uint64_t written_ = 0;
  std::string chunk_;
  std::map<uint16_t, std::vector<std::pair<int64_t, uint64_t>>> chunk_index_;  ///< channel -> time, place in the chunk
  std::vector<std::string> schemas_, channels_;                                ///< their records
  std::map<std::string, uint16_t> schema_of_name_;
  std::map<uint16_t, uint64_t> counts_;  ///< of messages
  std::vector<ChunkPlace> chunks_;
};

}  // namespace mvstudio::exports
