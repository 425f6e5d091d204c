import { defineConfig } from 'vite';

// The gateway serves what is built under any path, so addresses are relative. Nothing is taken from elsewhere: a session
// may run where there is no internet.
export default defineConfig({
  base: './',
  build: {
    // For CMake, which builds outside the sources: `SODA_PAGE_OUT=... npm run build`, or `npm run build -- --outDir ...`.
    outDir: process.env.SODA_PAGE_OUT ?? 'dist',
    emptyOutDir: true,
    target: 'es2022',
    chunkSizeWarningLimit: 1500,
  },
  server: {
    // `npm run dev` beside `npm run mock`, or beside a gateway named by $SODA_GATEWAY.
    proxy: { '/ws': { target: process.env.SODA_GATEWAY ?? 'ws://127.0.0.1:8089', ws: true } },
  },
});
