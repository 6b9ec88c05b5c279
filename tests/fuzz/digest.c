/* Inputs of chance in place of libFuzzer's: one line, a digest of all that the core gives for them.
 * It is the same on every processor and with every compiler. Words: how many inputs, and a seed. */
#include "abi.c"

int main(int count, char **words)
{
    const long inputs = count > 1 ? atol(words[1]) : 1000, seed = count > 2 ? atol(words[2]) : 1;
    uint64_t state = UINT64_C(0x9e3779b97f4a7c15) * (uint64_t)(2 * seed + 1);
    for (long k = 0; k < inputs; k++) {
        uint8_t data[600];
        size_t size = 0;
        for (size_t i = 0; i < sizeof data; i++) {
            state ^= state << 13, state ^= state >> 7, state ^= state << 17;
            if (!i) size = 1 + state % sizeof data;
            data[i] = (uint8_t)(state >> 32);
        }
        LLVMFuzzerTestOneInput(data, size);
    }
    printf("%ld inputs, %016llx\n", inputs, (unsigned long long)digest);
    return 0;
}
