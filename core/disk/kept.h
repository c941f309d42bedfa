#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

/// Results of long work that a later run may need, kept outside the user's folders.
namespace mvstudio {

/// Where they are kept: "auto", "off", or a folder.
struct CachePlace {
  enum class Kind {
    kAuto,  ///< the environment variable MVSTUDIO_CACHE (off or a folder) if it is set, else $XDG_CACHE_HOME/mvstudio or
            ///< ~/.cache/mvstudio
    kOff,
    kFolder,
  };
  Kind kind = Kind::kAuto;
  std::string folder;  ///< of kFolder
};
CachePlace CacheIn(const std::string& folder);
/// As an option, see core/fields.h.
std::string ToString(const CachePlace& place);
void FromString(const std::string& text, CachePlace* place);

/// Thrown by KeptReader, and by who decodes what it reads; never seen by users.
struct DamagedBytes {};

/// Values one after the other, in this machine's order of bytes.
class KeptWriter {
 public:
  template <class T>
  void Put(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void Put(const std::string& text) { PutAll(text.data(), text.size()); }
  /// Their number before them.
  template <class T>
  void PutAll(const T* values, size_t count) {
    static_assert(std::is_trivially_copyable_v<T>);
    Put<uint64_t>(count);
    bytes_.append(reinterpret_cast<const char*>(values), count * sizeof(T));
  }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

/// Reads what KeptWriter wrote. Throws DamagedBytes.
class KeptReader {
 public:
  explicit KeptReader(std::string_view bytes) : bytes_(bytes) {}
  template <class T>
  T Get() {
    T value;
    std::memcpy(&value, Bytes(sizeof value), sizeof value);
    return value;
  }
  /// A number of items of at least `item_size` bytes that the rest can hold.
  uint64_t Count(size_t item_size) {
    const auto count = Get<uint64_t>();
    if (count > bytes_.size() / item_size) throw DamagedBytes();
    return count;
  }
  template <class T>
  std::vector<T> All() {
    std::vector<T> values(Count(sizeof(T)));
    if (!values.empty()) std::memcpy(values.data(), Bytes(values.size() * sizeof(T)), values.size() * sizeof(T));
    return values;
  }
  std::string Text() {
    const uint64_t size = Count(1);
    return std::string(Bytes(size), size);
  }
  bool AtEnd() const { return bytes_.empty(); }

 private:
  const char* Bytes(size_t size) {
    if (size > bytes_.size()) throw DamagedBytes();
    const char* at = bytes_.data();
    bytes_.remove_prefix(size);
    return at;
  }
  std::string_view bytes_;
};

/// Kept results of one kind: files FOLDER/KIND/KEY.KIND with a digest at their end;
/// a key may name a folder, too (`camera/12`). Damaged ones count as missing. Several
/// processes may use one folder.
class KeptResults {
 public:
  KeptResults(const CachePlace& place, const std::string& kind);

  bool enabled() const { return !folder_.empty(); }
  const std::string& folder() const { return folder_; }

  std::optional<std::string> Load(const std::string& key) const;
  /// Whether there is one; it may be damaged.
  bool Has(const std::string& key) const;
  /// Never throws: on a full or read-only disk it only logs a warning.
  void Store(const std::string& key, std::string bytes) const;
  /// Removes it, or with a folder as key all that is in it. Never throws.
  void Remove(const std::string& key) const;
  /// Tells that what was loaded could not be decoded.
  void Damaged(const std::string& key) const;

 private:
  std::string PathOf(const std::string& key) const { return folder_ + "/" + key + "." + kind_; }
  std::string kind_, folder_;
};

}  // namespace mvstudio
