#include "stages/view/frame_store.h"

#include <filesystem>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;

/// Image n is grey of brightness 20 n.
void WriteGreys(const std::string& folder, int count) {
  fs::create_directories(folder);
  for (int n = 0; n < count; ++n)
    dataset::WriteImage(Image(64, 48, 3, static_cast<uint8_t>(20 * n)), folder + "/" + std::to_string(n) + ".png");
}

TEST(FrameStore, ReadsFramesOfAVideoInAnyOrder) {
  TempDir folder;
  dataset::VideoWriter video(folder / "a.mp4", 64, 48, 30);
  for (int n = 0; n < 12; ++n) video.Write(Image(64, 48, 3, static_cast<uint8_t>(20 * n)));
  video.Close();
  FrameStore store(folder.path(), 0);
  for (const int n : {3, 7, 7, 1, 11, 0}) {
    const Image image = store.Read(folder / "a.mp4", n);
    ASSERT_EQ(image.width, 64) << n;
    EXPECT_NEAR(*image.Pixel(30, 20), 20 * n, 3) << n;
  }
  EXPECT_TRUE(store.Read(folder / "a.mp4", 12).empty());
  EXPECT_NEAR(*store.Read(folder / "a.mp4", 4).Pixel(0, 0), 80, 3) << "after its end";
}

TEST(FrameStore, ReadsImagesByTheirNumbers) {
  TempDir folder;
  WriteGreys(folder / "a", 5);
  FrameStore store("", 1 << 20);
  EXPECT_EQ(*store.Read(folder / "a", 3).Pixel(0, 0), 60);
  EXPECT_TRUE(store.Read(folder / "a", 9).empty());
  EXPECT_TRUE(store.Read("", 0).empty());
  EXPECT_TRUE(store.Read(folder / "a", -1).empty());
}

TEST(FrameStore, KeepsTheLastOnesWithinItsMemory) {
  TempDir folder;
  WriteGreys(folder / "a", 5);
  FrameStore store("", 1 << 20);
  const std::string first = store.Jpeg(folder / "a", 0, 0);
  fs::remove(folder / "a/0.png");
  EXPECT_EQ(store.Jpeg(folder / "a", 0, 0), first) << "kept";
  EXPECT_LT(store.Jpeg(folder / "a", 1, 16).size(), first.size()) << "smaller";
  FrameStore little("", 1);
  for (int n = 1; n < 5; ++n) EXPECT_FALSE(little.Jpeg(folder / "a", n, 0).empty());
  EXPECT_EQ(little.bytes(), little.Jpeg(folder / "a", 4, 0).size()) << "one alone";
}

TEST(FrameStore, FollowsNoLinkOutOfItsRoot) {
  TempDir inside, outside;
  WriteGreys(inside / "a", 2);
  WriteGreys(outside / "b", 3);
  fs::create_symlink(outside / "b/2.png", inside / "a/2.png");
  FrameStore store(inside.path(), 0), free("", 0);
  EXPECT_EQ(*store.Read(inside / "a", 1).Pixel(0, 0), 20);
  EXPECT_THROW(store.Read(inside / "a", 2), UsageError);
  EXPECT_EQ(*free.Read(inside / "a", 2).Pixel(0, 0), 40);
}

}  // namespace
}  // namespace mvstudio::stages
