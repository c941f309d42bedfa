#include <limits>
#include <set>

#include "core/error.h"
#include "dataset/arrays/hdf5_handle.h"
#include "dataset/arrays/hdf5_reader.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr int kMaxRank = 8;
constexpr uint64_t kMaxTextBytes = 1 << 16;

uint64_t CheckedProduct(uint64_t a, uint64_t b) {
  const uint64_t max = std::numeric_limits<uint64_t>::max();
  return b != 0 && a > max / b ? max : a * b;  // `max` is beyond every limit
}

/// Walks the file from its root without following anything but hard links.
class StructureCheck {
 public:
  StructureCheck(const std::string& path, uint64_t file_bytes, const Hdf5Limits& limits)
      : path_(path), file_bytes_(file_bytes), limits_(limits) {}

  void Object(hid_t object, const std::string& name, int depth) {
    H5O_info_t info{};
    if (H5Oget_info2(object, &info, H5O_INFO_BASIC | H5O_INFO_NUM_ATTRS) < 0) Fail(name, "is damaged: " + LastHdf5Error());
    if (!seen_.insert(info.addr).second) Fail(name, "can be reached by two names or through itself; refused");
    if (seen_.size() > limits_.max_objects)
      Fail(name, "more than " + std::to_string(limits_.max_objects) + " objects; refused");
    Attributes(object, name, info.num_attrs);
    if (info.type == H5O_TYPE_GROUP) return Members(object, name, depth);
    if (info.type != H5O_TYPE_DATASET) Fail(name, "is neither group nor dataset; refused");
    Dataset(object, name);
  }

 private:
  [[noreturn]] void Fail(const std::string& name, const std::string& what) const { throw FormatError(path_, name, what); }

  void Members(hid_t group, const std::string& name, int depth) {
    if (depth > limits_.max_depth) Fail(name, "groups are nested deeper than " + std::to_string(limits_.max_depth));
    H5G_info_t info{};
    if (H5Gget_info(group, &info) < 0) Fail(name, "is damaged: " + LastHdf5Error());
    if (info.nlinks > limits_.max_objects) Fail(name, "holds " + std::to_string(info.nlinks) + " members; refused");
    for (hsize_t i = 0; i < info.nlinks; ++i) Member(group, name, i, depth);
  }

  void Member(hid_t group, const std::string& parent, hsize_t idx, int depth) {
    char text[256];
    const ssize_t length = H5Lget_name_by_idx(group, ".", H5_INDEX_NAME, H5_ITER_INC, idx, text, sizeof(text), H5P_DEFAULT);
    if (length <= 0 || length >= static_cast<ssize_t>(sizeof(text))) Fail(parent, "has a member with an unusable name");
    const std::string name = (parent == "/" ? "" : parent) + "/" + text;
    H5L_info_t link{};
    if (H5Lget_info(group, text, &link, H5P_DEFAULT) < 0) Fail(name, "is damaged: " + LastHdf5Error());
    if (link.type == H5L_TYPE_SOFT) Fail(name, "is a soft link; refused");
    if (link.type == H5L_TYPE_EXTERNAL) Fail(name, "is a link to another file; refused");
    if (link.type != H5L_TYPE_HARD) Fail(name, "is a link of unknown kind; refused");
    const Hid object(H5Oopen(group, text, H5P_DEFAULT), H5Oclose);
    if (!object.ok()) Fail(name, "is damaged: " + LastHdf5Error());
    Object(object, name, depth + 1);
  }

  void Attributes(hid_t object, const std::string& name, uint64_t count) {
    if (count > static_cast<uint64_t>(limits_.max_attributes))
      Fail(name, "has " + std::to_string(count) + " attributes; refused");
    for (hsize_t i = 0; i < count; ++i) {
      const Hid attribute(H5Aopen_by_idx(object, ".", H5_INDEX_NAME, H5_ITER_INC, i, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
      if (!attribute.ok()) Fail(name, "has a damaged attribute: " + LastHdf5Error());
      const Hid type(H5Aget_type(attribute), H5Tclose);
      const Hid space(H5Aget_space(attribute), H5Sclose);
      const std::string place = name + "@" + std::to_string(i);
      const uint64_t bytes = CheckedProduct(Elements(space, place), TypeBytes(type, place));
      if (bytes > kMaxTextBytes) Fail(place, "is an attribute of " + std::to_string(bytes) + " bytes; refused");
    }
  }

  // Bytes of one element of a type that can be read without following anything.
  uint64_t TypeBytes(hid_t type, const std::string& name) const {
    if (type < 0) Fail(name, "has a damaged type");
    const H5T_class_t kind = H5Tget_class(type);
    const size_t bytes = H5Tget_size(type);
    if (kind == H5T_STRING && H5Tis_variable_str(type) == 0 && bytes > 0 && bytes <= kMaxTextBytes) return bytes;
    if (kind != H5T_INTEGER && kind != H5T_FLOAT) {
      Fail(name, "holds something else than plain numbers or text of fixed length (variable length, references, …); refused");
    }
    for (const hid_t known : {H5T_STD_U8LE, H5T_STD_I8LE, H5T_STD_U16LE, H5T_STD_I16LE, H5T_STD_U32LE, H5T_STD_I32LE,
                              H5T_STD_U64LE, H5T_STD_I64LE, H5T_IEEE_F32LE, H5T_IEEE_F64LE}) {
      if (H5Tequal(type, known) > 0) return bytes;
    }
    Fail(name, "holds numbers that are not little-endian of 1, 2, 4 or 8 bytes; refused");
  }

  uint64_t Elements(hid_t space, const std::string& name) const {
    const H5S_class_t kind = space < 0 ? H5S_NO_CLASS : H5Sget_simple_extent_type(space);
    if (kind == H5S_SCALAR) return 1;
    if (kind == H5S_NULL) return 0;
    const int rank = kind == H5S_SIMPLE ? H5Sget_simple_extent_ndims(space) : -1;
    if (rank < 1 || rank > kMaxRank) Fail(name, "has " + std::to_string(rank) + " dimensions; refused");
    hsize_t dims[kMaxRank], max_dims[kMaxRank];
    H5Sget_simple_extent_dims(space, dims, max_dims);
    uint64_t count = 1;
    for (int k = 0; k < rank; ++k) count = CheckedProduct(count, dims[k]);
    return count;
  }

  void Dataset(hid_t dataset, const std::string& name) {
    const Hid type(H5Dget_type(dataset), H5Tclose);
    const Hid space(H5Dget_space(dataset), H5Sclose);
    const uint64_t item_bytes = TypeBytes(type, name);
    const uint64_t bytes = CheckedProduct(Elements(space, name), item_bytes);
    const Hid properties(H5Dget_create_plist(dataset), H5Pclose);
    if (!properties.ok()) Fail(name, "is damaged: " + LastHdf5Error());
    const bool packed = Filters(properties, name);
    Layout(properties, name, item_bytes);
    const double room = static_cast<double>(file_bytes_) * (packed ? limits_.max_ratio : 1);
    if (bytes > limits_.max_bytes || static_cast<double>(bytes) > room) {
      Fail(name, "claims " + std::to_string(bytes) + " bytes in a file of " + std::to_string(file_bytes_) + "; refused");
    }
    total_bytes_ += bytes;
    if (total_bytes_ > limits_.max_bytes ||
        static_cast<double>(total_bytes_) > static_cast<double>(file_bytes_) * limits_.max_ratio)
      Fail(name, "and what stands before it claim more data than the file can hold; refused");
  }

  // True when the data are compressed.
  bool Filters(hid_t properties, const std::string& name) const {
    const int count = H5Pget_nfilters(properties);
    bool packed = false;
    for (int i = 0; i < count; ++i) {
      unsigned flags = 0, config = 0;
      size_t num_values = 0;
      char text[8];
      const H5Z_filter_t filter =
          H5Pget_filter2(properties, static_cast<unsigned>(i), &flags, &num_values, nullptr, sizeof(text), text, &config);
      if (filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_FLETCHER32) {
        Fail(name, "is packed with the filter " + std::to_string(filter) + "; only shuffle, deflate and fletcher32 are read");
      }
      packed = packed || filter == H5Z_FILTER_DEFLATE;
    }
    if (count < 0 || count > 4) Fail(name, "has a damaged list of filters");
    return packed;
  }

  void Layout(hid_t properties, const std::string& name, uint64_t item_bytes) const {
    const H5D_layout_t layout = H5Pget_layout(properties);
    if (layout == H5D_VIRTUAL) Fail(name, "is a virtual dataset; refused");
    if (layout < 0) Fail(name, "is damaged: " + LastHdf5Error());
    if (H5Pget_external_count(properties) != 0) Fail(name, "keeps its data in another file; refused");
    if (layout != H5D_CHUNKED) return;
    hsize_t chunk[kMaxRank];
    const int rank = H5Pget_chunk(properties, kMaxRank, chunk);
    if (rank < 1 || rank > kMaxRank) Fail(name, "has damaged chunks");
    uint64_t bytes = item_bytes;
    for (int k = 0; k < rank; ++k) bytes = CheckedProduct(bytes, chunk[k]);
    if (bytes > limits_.max_chunk_bytes) Fail(name, "has chunks of " + std::to_string(bytes) + " bytes; refused");
  }

  const std::string& path_;
  const uint64_t file_bytes_;
  const Hdf5Limits limits_;
  std::set<haddr_t> seen_;
  uint64_t total_bytes_ = 0;
};

}  // namespace

void CheckHdf5Structure(hid_t file, const std::string& path, uint64_t file_bytes, const Hdf5Limits& limits) {
  const Hid root(H5Oopen(file, "/", H5P_DEFAULT), H5Oclose);
  if (!root.ok()) throw FormatError(path, "/", "is damaged: " + LastHdf5Error());
  StructureCheck(path, file_bytes, limits).Object(root, "/", 0);
}

}  // namespace mvstudio::dataset::internal
