#include "avatar/data/safetensors.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "avatar/data/safetensors_header.h"
#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/hash/sha256.h"

namespace mvstudio::avatar {
namespace {

using internal::kDigestPrefix;
using internal::TensorEntry;
using internal::TensorHeader;

struct TypeName {
  const char* name;
  at::ScalarType type;
};
constexpr TypeName kTypes[] = {{"U8", at::kByte},    {"I8", at::kChar},  {"I16", at::kShort},     {"I32", at::kInt},
                               {"I64", at::kLong},   {"F16", at::kHalf}, {"BF16", at::kBFloat16}, {"F32", at::kFloat},
                               {"F64", at::kDouble}, {"BOOL", at::kBool}};

std::string NameOfType(at::ScalarType type, const std::string& tensor) {
  for (const TypeName& t : kTypes) {
    if (t.type == type) return t.name;
  }
  MVS_CHECK(false, "tensor '" << tensor << "' has a type that the file format does not know");
  return {};
}

at::Tensor ReadTensor(const TensorEntry& entry, const char* data) {
  const auto* type =
      std::find_if(std::begin(kTypes), std::end(kTypes), [&](const TypeName& t) { return t.name == entry.type; });
  at::Tensor tensor = at::empty(entry.shape, at::TensorOptions().dtype(type->type));
  if (entry.end > entry.begin) std::memcpy(tensor.data_ptr(), data + entry.begin, entry.end - entry.begin);
  return tensor;
}

}  // namespace

void WriteTensorFile(const TensorFile& file, const std::string& path) {
  TensorHeader header;
  header.metadata = file.metadata;
  std::vector<std::pair<int64_t, std::string>> order;
  std::map<std::string, at::Tensor> tensors;
  for (const auto& [name, tensor] : file.tensors) {
    MVS_CHECK(tensor.defined() && name != "__metadata__", "tensor '" << name << "' cannot be written");
    tensors[name] = tensor.detach().to(at::kCPU).contiguous();
    order.push_back({-static_cast<int64_t>(tensor.element_size()), name});
  }
  std::sort(order.begin(), order.end());  // large elements first keeps all of them aligned
  uint64_t end = 0;
  for (const auto& item : order) {
    const at::Tensor& tensor = tensors[item.second];
    TensorEntry& entry = header.entries[item.second];
    entry.type = NameOfType(tensor.scalar_type(), item.second);
    entry.shape = tensor.sizes().vec();
    entry.begin = end, entry.end = end += tensor.nbytes();
    header.metadata[std::string(kDigestPrefix) + item.second] = Sha256Hex(tensor.data_ptr(), tensor.nbytes());
  }
  header.metadata[kDigestPrefix] = internal::DigestOfHeader(header);
  const std::string text = internal::HeaderText(header);
  MVS_CHECK(text.size() <= internal::kMaxHeaderBytes, "the header would need " << text.size() << " bytes");
  std::string content(8, '\0');
  for (int i = 0; i < 8; ++i) content[i] = static_cast<char>((text.size() >> (8 * i)) & 0xff);
  content += text;
  content.reserve(content.size() + end);
  for (const auto& item : order)
    content.append(static_cast<const char*>(tensors[item.second].data_ptr()), tensors[item.second].nbytes());
  WriteFileAtomic(path, content);
}

TensorFile ReadTensorFile(const std::string& path, bool require_digests) {
  const std::string content = ReadFile(path);
  const internal::TensorLayout layout = internal::ParseTensorLayout(content, require_digests, path);
  const char* data = content.data() + layout.data_at;
  TensorFile file;
  for (const auto& [name, entry] : layout.header.entries) {
    const auto digest = layout.digests.find(name);
    const bool unchecked = digest == layout.digests.end();
    if (unchecked ? require_digests : Sha256Hex(data + entry.begin, entry.end - entry.begin) != digest->second) {
      throw FormatError(path, name, "its data does not match its digest: damaged file");
    }
    file.tensors[name] = ReadTensor(entry, data);
  }
  for (const auto& [key, value] : layout.header.metadata) {
    if (key.compare(0, std::strlen(kDigestPrefix), kDigestPrefix) != 0) file.metadata[key] = value;
  }
  return file;
}

}  // namespace mvstudio::avatar
