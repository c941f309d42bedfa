#include "avatar/data/safetensors.h"

#include <ATen/ATen.h>

#include <cstdio>
#include <filesystem>

#include "avatar/data/pack.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/avatar/synthetic_pack.h"
#include "tests/support/test.h"

namespace mvstudio::avatar {
namespace {

class SafetensorsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("mvstudio_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "file.safetensors").string();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  TensorFile Example() const {
    TensorFile file;
    file.tensors["weight"] = at::arange(12, at::kFloat).view({3, 4});
    file.tensors["count"] = at::arange(5, at::kLong) - 2;
    file.tensors["flag"] = at::tensor({1, 0, 1}, at::kByte).to(at::kBool);
    file.tensors["half"] = at::ones({2}, at::kHalf);
    file.tensors["empty"] = at::zeros({0, 7}, at::kDouble);
    file.tensors["scalar \"x\"\n"] = at::full({}, 2.5, at::kDouble);
    file.metadata = {{"step", "12"}, {"text", "line\nbreak \\ \"quote\" é"}};
    return file;
  }

  /// Writes `json` as a header before `data`, without digests.
  void WriteRaw(const std::string& json, const std::string& data) const {
    std::string content(8, '\0');
    for (int i = 0; i < 8; ++i) content[i] = static_cast<char>((json.size() >> (8 * i)) & 0xff);
    WriteFileAtomic(path_, content + json + data);
  }

  std::filesystem::path folder_;
  std::string path_;
};

TEST_F(SafetensorsTest, RoundTripIsExact) {
  const TensorFile file = Example();
  WriteTensorFile(file, path_);
  const TensorFile back = ReadTensorFile(path_);
  EXPECT_EQ(back.metadata, file.metadata);
  ASSERT_EQ(back.tensors.size(), file.tensors.size());
  for (const auto& [name, tensor] : file.tensors) EXPECT_TRUE(at::equal(back.tensors.at(name), tensor)) << name;
}

TEST_F(SafetensorsTest, EveryFlippedByteIsFound) {
  WriteTensorFile(Example(), path_);
  const std::string good = ReadFile(path_);
  int unnoticed = 0;
  for (size_t i = 0; i < good.size(); ++i) {
    for (const int flip : {1 << (i % 8), 0x20}) {
      std::string bad = good;
      bad[i] = static_cast<char>(bad[i] ^ flip);
      std::FILE* file = std::fopen(path_.c_str(), "wb");
      std::fwrite(bad.data(), 1, bad.size(), file);
      std::fclose(file);
      try {
        ReadTensorFile(path_);
        ++unnoticed;
        ADD_FAILURE() << "byte " << i << " of " << good.size() << " xor " << flip;
      } catch (const FormatError&) {
      }
    }
  }
  EXPECT_EQ(unnoticed, 0);
}

TEST_F(SafetensorsTest, TruncatedFilesAreRefused) {
  WriteTensorFile(Example(), path_);
  const std::string good = ReadFile(path_);
  for (const size_t size : {size_t{0}, size_t{7}, size_t{8}, size_t{100}, good.size() / 2, good.size() - 1}) {
    WriteFileAtomic(path_, good.substr(0, size));
    EXPECT_THROW(ReadTensorFile(path_), FormatError) << size;
  }
  WriteFileAtomic(path_, good + "x");
  EXPECT_THROW(ReadTensorFile(path_), FormatError);
  EXPECT_THROW(ReadTensorFile((folder_ / "absent").string()), IoError);
}

TEST_F(SafetensorsTest, ForeignFilesAreReadWhenDigestsAreNotRequired) {
  WriteRaw(R"({ "a" : {"dtype":"F32", "shape":[2], "data_offsets":[0, 8]} }  )", std::string("\0\0\x80\x3f\0\0\0\x40", 8));
  EXPECT_THROW(ReadTensorFile(path_), FormatError);
  const TensorFile file = ReadTensorFile(path_, false);
  EXPECT_EQ(file.tensors.at("a")[1].item<float>(), 2.0f);
}

TEST_F(SafetensorsTest, HostileHeadersAreRefused) {
  const std::string data(8, '\0');
  for (const char* header :
       {R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,9]}})",
        R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[4,8]}})",
        R"({"a":{"dtype":"F32","shape":[3],"data_offsets":[0,8]}})",
        R"({"a":{"dtype":"F99","shape":[2],"data_offsets":[0,8]}})",
        R"({"a":{"dtype":"F32","shape":[4611686018427387904,4],"data_offsets":[0,8]}})",
        R"({"a":{"dtype":"F32","shape":[288230376151711743,576460752303423488],"data_offsets":[0,8]}})",
        R"({"a":{"dtype":"F32","shape":[-2],"data_offsets":[0,8]}})",
        R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[8,0]}})",
        R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},"b":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}})",
        R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},"a":{"dtype":"F32","shape":[1],"data_offsets":[4,8]}})",
        R"({"a":{"dtype":"F32","shape":[2]}})", R"({"a":[[[[[[]]]]]]})",
        R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]})", "", "{}",
        R"({"__metadata__":{"x":1},"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})"}) {
    WriteRaw(header, data);
    EXPECT_THROW(ReadTensorFile(path_, false), FormatError) << header;
  }
  WriteFileAtomic(path_, std::string(8, '\xff') + "{}");
  EXPECT_THROW(ReadTensorFile(path_, false), FormatError);
}

TEST_F(SafetensorsTest, PackRoundTripAndSelection) {
  const AvatarPack pack = MakeSyntheticPack(5, 32, 1);
  SavePack(pack, path_);
  const AvatarPack back = LoadPack(path_);
  EXPECT_EQ(back.cameras, pack.cameras);
  EXPECT_EQ(back.size_px, 32);
  EXPECT_TRUE(at::equal(back.images, pack.images) && at::equal(back.uv, pack.uv) &&
              at::equal(back.joint_valid, pack.joint_valid));
  const AvatarPack some = Select(pack, {3, 0});
  EXPECT_TRUE(at::equal(some.images[0], pack.images[3]) && at::equal(some.frame[1], pack.frame[0]));
  EXPECT_THROW(Select(pack, {5}), ContractViolation);
}

TEST_F(SafetensorsTest, PackProblemsNameCameraAndFrame) {
  AvatarPack pack = MakeSyntheticPack(5, 32, 1);
  pack.joints_in_cam[3][4][1] = std::nan("");
  try {
    Validate(pack);
    FAIL();
  } catch (const ContractViolation& error) {
    EXPECT_NE(std::string(error.what()).find("camera cam_01, frame 1"), std::string::npos) << error.what();
  }
  pack = MakeSyntheticPack(5, 32, 1);
  pack.masks[0][0][0] = 7;
  EXPECT_THROW(Validate(pack), ContractViolation);
  pack = MakeSyntheticPack(5, 32, 1);
  pack.uv = pack.uv.to(at::kDouble);
  EXPECT_THROW(Validate(pack), ContractViolation);
  pack = MakeSyntheticPack(5, 32, 1);
  pack.camera_idx[2] = 2;
  EXPECT_THROW(SavePack(pack, path_), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::avatar
